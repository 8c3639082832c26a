/* The figure posed, drawn into the z-buffer and shaded sample by sample. */
#include "lib/lab/people/scan_stage.h"

#include <string.h>

#include "lib/base/vec3.h"

int scan_stage_init(struct scan_stage *s, int size, struct error *err)
{
    size_t n = (size_t)size * (size_t)size;
    size_t m = n * SCAN_GRID * SCAN_GRID;
    size_t t = (size_t)SCAN_SHADOW * SCAN_SHADOW;
    struct arena *a = &s->memory;

    *s = (struct scan_stage){.size = size, .grid = size * SCAN_GRID};
    s->face = arena_take(a, 3 * FACE_VERTICES, sizeof *s->face);
    s->face_normal = arena_take(a, 3 * FACE_VERTICES, sizeof *s->face_normal);
    s->q = arena_take(a, m, sizeof *s->q);
    s->b1 = arena_take(a, m, sizeof *s->b1);
    s->b2 = arena_take(a, m, sizeof *s->b2);
    s->id = arena_take(a, m, sizeof *s->id);
    s->color = arena_take(a, 3 * m, sizeof *s->color);
    s->cover = arena_take(a, m, sizeof *s->cover);
    s->label = arena_take(a, m, 1);
    s->flat = arena_take(a, t, sizeof *s->flat);
    for (int i = 0; i < LIGHT_LAMPS; i++)
        s->shadow[i].map = arena_take(a, t, sizeof *s->shadow[i].map);
    s->light = arena_take(a, 3 * n, sizeof *s->light);
    s->alpha = arena_take(a, n, sizeof *s->alpha);
    s->front = arena_take(a, 3 * n, sizeof *s->front);
    s->block = arena_take(a, n, sizeof *s->block);
    s->tag = arena_take(a, n, 1);
    return arena_check(a, "a picture", err);
}

void scan_stage_release(struct scan_stage *s)
{
    arena_release(&s->memory);
    arena_release(&s->corners);
    *s = (struct scan_stage){0};
}

/* Room for this figure. */
static int stage_fit_figure(struct scan_stage *s, const struct figure *f,
                            struct error *err)
{
    struct arena *a = &s->corners;
    const size_t n = f->nc + f->nc / 8, veils = f->nveil + f->nveil / 8;

    if (f->nc <= s->room && f->nveil <= s->veil_room)
        return 0;
    s->room = s->veil_room = 0;
    arena_release(a);
    s->head = arena_take(a, 3 * n, sizeof *s->head);
    s->place = arena_take(a, 3 * n, sizeof *s->place);
    s->normal = arena_take(a, 3 * n, sizeof *s->normal);
    s->bright = arena_take(a, 3 * n, sizeof *s->bright);
    s->spot = arena_take(a, n, sizeof *s->spot);
    s->sun = arena_take(a, n, sizeof *s->sun);
    s->order = arena_take(a, veils, sizeof *s->order);
    if (arena_check(a, "a picture", err))
        return -1;
    s->room = n;
    s->veil_room = veils;
    return 0;
}

/* Mean of a pixel's samples; its label is the commonest of them. */
static void stage_resolve(struct scan_stage *s)
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
    stage_resolve(s);
    return 0;
}
