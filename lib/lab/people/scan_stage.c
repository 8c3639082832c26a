/* The figure posed, drawn into the z-buffer and shaded sample by sample. */
#include "lib/lab/people/scan_stage.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/people/label.h"
#include "lib/lab/people/vec.h"

static int stage_memory(struct error *err)
{
    return error_set(err, EX_OSERR, "out of memory for a picture");
}

int scan_stage_init(struct scan_stage *s, int size, struct error *err)
{
    size_t n = (size_t)size * (size_t)size;
    size_t m = n * SCAN_GRID * SCAN_GRID;
    size_t t = (size_t)SCAN_SHADOW * SCAN_SHADOW;
    bool ok = true;

    *s = (struct scan_stage){.size = size, .grid = size * SCAN_GRID};
    s->face = malloc(3 * FACE_VERTICES * sizeof *s->face);
    s->face_normal = malloc(3 * FACE_VERTICES * sizeof *s->face_normal);
    s->q = malloc(m * sizeof *s->q);
    s->b1 = malloc(m * sizeof *s->b1);
    s->b2 = malloc(m * sizeof *s->b2);
    s->id = malloc(m * sizeof *s->id);
    s->color = malloc(3 * m * sizeof *s->color);
    s->cover = malloc(m * sizeof *s->cover);
    s->label = malloc(m);
    s->flat = malloc(t * sizeof *s->flat);
    for (int i = 0; i < LIGHT_LAMPS; i++) {
        s->shadow[i].map = malloc(t * sizeof *s->shadow[i].map);
        ok = ok && s->shadow[i].map;
    }
    s->light = malloc(3 * n * sizeof *s->light);
    s->alpha = malloc(n * sizeof *s->alpha);
    s->front = malloc(3 * n * sizeof *s->front);
    s->block = malloc(n * sizeof *s->block);
    s->tag = malloc(n);
    if (ok && s->face && s->face_normal && s->q && s->b1 && s->b2 && s->id
        && s->color && s->cover && s->label && s->flat && s->light && s->alpha
        && s->front && s->block && s->tag)
        return 0;
    scan_stage_release(s);
    return stage_memory(err);
}

/* What was sized by the last figure. */
static void stage_release_figure(struct scan_stage *s)
{
    free(s->head);
    free(s->place);
    free(s->normal);
    free(s->bright);
    free(s->fold);
    free(s->spot);
    free(s->sun);
    s->head = s->place = s->normal = s->bright = s->fold = NULL;
    s->spot = s->sun = NULL;
    s->room = 0;
}

void scan_stage_release(struct scan_stage *s)
{
    stage_release_figure(s);
    free(s->order);
    free(s->face);
    free(s->face_normal);
    free(s->q);
    free(s->b1);
    free(s->b2);
    free(s->id);
    free(s->color);
    free(s->cover);
    free(s->label);
    free(s->flat);
    for (int i = 0; i < LIGHT_LAMPS; i++)
        free(s->shadow[i].map);
    free(s->light);
    free(s->alpha);
    free(s->front);
    free(s->block);
    free(s->tag);
    *s = (struct scan_stage){0};
}

/* Room for this figure. */
static int stage_fit_figure(struct scan_stage *s, const struct figure *f,
                            struct error *err)
{
    if (f->nc > s->room) {
        size_t n = f->nc + f->nc / 8;
        stage_release_figure(s);
        s->head = malloc(3 * n * sizeof *s->head);
        s->place = malloc(3 * n * sizeof *s->place);
        s->normal = malloc(3 * n * sizeof *s->normal);
        s->bright = malloc(3 * n * sizeof *s->bright);
        s->fold = malloc(n * sizeof *s->fold);
        s->spot = malloc(n * sizeof *s->spot);
        s->sun = malloc(n * sizeof *s->sun);
        if (!s->head || !s->place || !s->normal || !s->bright || !s->fold
            || !s->spot || !s->sun)
            return stage_memory(err);
        s->room = n;
    }
    if (f->nveil > s->veil_room) {
        uint64_t *o = realloc(s->order, f->nveil * sizeof *o);
        if (!o)
            return stage_memory(err);
        s->order = o;
        s->veil_room = f->nveil;
    }
    return 0;
}

int scan_stage_render(struct scan_stage *s, const struct figure *f,
                      const struct act *act, const struct scan_view *v,
                      struct error *err)
{
    if (stage_fit_figure(s, f, err))
        return -1;
    s->figure = f;
    s->act = act;
    s->view = *v;
    scan_pose(s);
    scan_shadows(s);
    scan_draw(s);
    scan_veils(s);
    scan_resolve(s);
    return 0;
}

/* Mean of a pixel's samples; its label is the commonest of them. */
void scan_resolve(struct scan_stage *s)
{
    enum { N = SCAN_GRID * SCAN_GRID };

    for (int y = 0; y < s->size; y++)
        for (int x = 0; x < s->size; x++) {
            size_t pixel = (size_t)y * (size_t)s->size + (size_t)x;
            float sum[2][3] = {{0}}, cover[2] = {0, 0};
            int best = 0;
            uint8_t l[N];
            for (int i = 0; i < N; i++) {
                size_t at = (size_t)(y * SCAN_GRID + i / SCAN_GRID)
                            * (size_t)s->grid
                            + (size_t)(x * SCAN_GRID + i % SCAN_GRID);
                l[i] = s->label[at];
                bool front = l[i] == LABEL_OCCLUDER;
                cover[front] += s->cover[at] * (1.0f / N);
                mad3(sum[front], sum[front], s->color + 3 * at, 1.0f / N);
            }
            for (int i = 0; i < N; i++) {
                int same = 0;
                for (int j = 0; j < N; j++)
                    same += l[j] == l[i];
                if (same > best) {
                    best = same;
                    s->tag[pixel] = l[i];
                }
            }
            copy3(s->light + 3 * pixel, sum[0]);
            copy3(s->front + 3 * pixel, sum[1]);
            s->alpha[pixel] = cover[0];
            s->block[pixel] = cover[1];
        }
}
