/* The actor posed, drawn into the z-buffer, gathered and shaded. */
#include "lib/lab/people/stage.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/lab/people/motion.h"

int stage_init(struct stage *s, int size, struct error *err)
{
    size_t n = (size_t)size * (size_t)size;
    size_t m = n * STAGE_GRID * STAGE_GRID;
    size_t t = (size_t)STAGE_SHADOW * STAGE_SHADOW;

    *s = (struct stage){ .size = size };
    if (raster_init(&s->eye, size * STAGE_GRID, size * STAGE_GRID, err)
        || raster_init(&s->sun, STAGE_SHADOW, STAGE_SHADOW, err))
        goto out;
    s->shadow = malloc(t * sizeof(float));
    s->blur = malloc(t * sizeof(float));
    s->ao = malloc(n * sizeof(float));
    s->ao_blur = malloc(n * sizeof(float));
    s->sample = malloc(3 * m * sizeof(float));
    s->light = malloc(3 * n * sizeof(float));
    s->scratch = malloc(3 * n * sizeof(float));
    s->cover = malloc(n * sizeof(float));
    s->label = malloc(n);
    s->mask = malloc(n);
    s->rgb = malloc(3 * n);
    if (s->shadow && s->blur && s->ao && s->ao_blur && s->sample && s->light
        && s->scratch && s->cover && s->label && s->mask && s->rgb)
        return 0;
    error_set(err, EX_OSERR, "out of memory for a picture of %d pixels", size);
out:
    stage_release(s);
    return -1;
}

/* What was sized by the last actor. */
static void stage_release_actor(struct stage *s)
{
    free(s->verts);
    free(s->place);
    free(s->normal);
    free(s->spot);
    free(s->tuft);
    free(s->tuft_normal);
    free(s->tuft_spot);
    free(s->owner);
    s->verts = s->place = s->normal = s->tuft = s->tuft_normal = NULL;
    s->spot = s->tuft_spot = NULL;
    s->owner = NULL;
    s->room_v = s->room_p = 0;
}

void stage_release(struct stage *s)
{
    raster_release(&s->eye);
    raster_release(&s->sun);
    stage_release_actor(s);
    free(s->shadow);
    free(s->blur);
    free(s->ao);
    free(s->ao_blur);
    free(s->sample);
    free(s->light);
    free(s->scratch);
    free(s->cover);
    free(s->label);
    free(s->mask);
    free(s->rgb);
    *s = (struct stage){ 0 };
}

/* Room for this actor's vertices and strands. */
static int stage_fit(struct stage *s, const struct actor *a, struct error *err)
{
    if (a->nv <= s->room_v && a->npoint <= s->room_p && s->verts)
        return 0;
    size_t v = a->nv + 64, p = a->npoint + a->npoint / 4 + 64;
    stage_release_actor(s);
    s->verts = malloc(3 * v * sizeof(float));
    s->place = malloc(3 * v * sizeof(float));
    s->normal = malloc(3 * v * sizeof(float));
    s->spot = malloc(v * sizeof *s->spot);
    s->tuft = malloc(3 * p * sizeof(float));
    s->tuft_normal = malloc(3 * p * sizeof(float));
    s->tuft_spot = malloc(p * sizeof *s->tuft_spot);
    s->owner = malloc(p * sizeof *s->owner);
    if (!(s->verts && s->place && s->normal && s->spot && s->tuft
          && s->tuft_normal && s->tuft_spot && s->owner))
        return error_set(err, EX_OSERR, "out of memory for %zu points", p);
    s->room_v = v;
    s->room_p = p;
    return 0;
}

/* Backs are drawn too: our sheets are seen from both sides, and at the corner
 * of an eye one looks into the head. */
static void stage_draw(struct stage *s, const struct actor *a)
{
    float focal = camera_focal((float)s->eye.w);

    raster_clear(&s->eye);
    raster_triangles(&s->eye, s->spot, a->faces, a->nf, 0, 0);
    for (size_t i = 0; i < a->nstrand; i++) {
        const struct strand *t = &a->strand[i];
        const struct raster_vertex *v = s->tuft_spot + t->first;
        raster_strand(&s->eye, v, t->points, t->first,
                      t->half * focal * v->q, t->tip);
    }
}

int stage_render(struct stage *s, const struct actor *a,
                 const struct synth_motion *m, struct error *err)
{
    struct shade_env env = a->look.env;

    if (stage_fit(s, a, err))
        return -1;
    stage_pose(s, a, m);
    stage_draw(s, a);
    stage_shadow(s, a, &env);
    stage_occlusion(s, a);
    stage_shade(s, a, &env);
    stage_resolve(s, a);
    return 0;
}
