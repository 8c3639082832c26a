/* Pruning by drawing: the sum of a Gaussian's weights in a view is the
 * gradient of the picture's sum by its colour. */
#include "lib/avatar/prune.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/arena.h"
#include "lib/base/cpu.h"
#include "lib/base/sort.h"
#include "lib/base/camera.h"
#include "lib/base/vec3.h"
#include "lib/splat/splat.h"

enum { YAWS = 5, NODS = 3, POSES = 2, VIEWS = YAWS * NODS * POSES };

#define STEP 20.0f          /* degrees from one yaw or nod to the next */
#define JAW_OPEN 0.35f      /* radians, of the second pose */

struct prune {
    struct arena memory;
    const struct baked *b;
    size_t size;
    float *verts;           /* (POSES, V, 3) */
    struct baked_move move;
    float *full;            /* (VIEWS, size, size, 3) of the full set */
    float *image;           /* (size, size, 3) */
    float *ones;            /* (size, size) */
    float *weight;          /* (N) of one view */
    double *max;           /* (N) over all views */
    double ms[VIEWS];
};

/* The camera of view v, turned about the head's origin. */
static void prune_view_camera(float cam[12], size_t v)
{
    /* a picture's half side is one head unit there */
    const float t[3] = {0, 0, CAMERA_FOCAL};
    float yaw = ((float)(v % YAWS) - 2) * STEP * DEGREE_F;
    float nod = ((float)(v / YAWS % NODS) - 1) * STEP * DEGREE_F;
    float Y[9], X[9], R[9], F[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1}, A[9];

    rotation_exp(Y, (const float[3]){0, yaw, 0});
    rotation_exp(X, (const float[3]){nod, 0, 0});
    mat3_mul(A, X, Y);
    mat3_mul(R, F, A);
    camera_make(cam, R, t);
}

/* Draw view v of b; the time in ms is kept. */
static int prune_draw(struct prune *p, struct splat *s,
                      const struct densify *d, const struct head *h,
                      float *image, size_t v, struct error *err)
{
    const float *verts = p->verts + v / (YAWS * NODS) * 3 * h->V;
    struct head_mouth m;
    float cam[12];

    prune_view_camera(cam, v);
    head_mouth(&m, h, verts);
    baked_drive(&p->move, p->b, d, verts, m.centre, m.chin, INFINITY, cam);
    struct splat_camera c = splat_camera_square(cam, (int)p->size,
                                                CAMERA_FOCAL);
    double begun = cpu_seconds();
    if (baked_move_scene(s, &p->move, p->b, err) ||
        splat_draw(s, &(struct splat_pictures){.image = image}, &c, NULL, NULL,
                   err))
        return -1;
    p->ms[v] = 1e3 * (cpu_seconds() - begun);
    return 0;
}

/* A renderer that has loaded the set. */
static int prune_open_renderer(struct splat *s, const struct prune *p,
                               int channels, int gradients, struct error *err)
{
    struct splat_options opt = splat_defaults((int)p->size, (int)p->size,
                                              channels);
    struct gaussians g = baked_set(p->b);

    opt.gradients = gradients;
    if (splat_init(s, &opt, err))
        return -1;
    if (splat_load(s, &g, err)) {
        splat_release(s);
        return -1;
    }
    return 0;
}

/* Largest summed weight of every Gaussian over the views. */
static int prune_measure(struct prune *p, const struct densify *d,
                         const struct head *h, struct error *err)
{
    const struct splat_picture_gradients ones = {.image = p->ones};
    struct splat_gradients g = {.color = p->weight};
    struct splat s = {0};
    int rc = prune_open_renderer(&s, p, 1, 1, err);

    for (size_t v = 0; rc == 0 && v < VIEWS; v++) {
        memset(p->weight, 0, p->b->N * sizeof *p->weight);
        rc = prune_draw(p, &s, d, h, p->image, v, err);
        if (rc == 0)
            rc = splat_backward(&s, &g, &ones, err);
        for (size_t i = 0; i < p->b->N; i++)
            p->max[i] = fmax(p->max[i], p->weight[i]);
    }
    splat_release(&s);
    return rc;
}

/* Draw all views into images, or compare with them. */
static int prune_draw_all(struct prune *p, const struct densify *d,
                          const struct head *h, struct prune_report *r,
                          double *median, struct error *err)
{
    size_t n = 3 * p->size * p->size;
    struct splat s = {0};
    int rc = prune_open_renderer(&s, p, 3, 0, err);

    for (size_t v = 0; rc == 0 && v < VIEWS; v++) {
        float *full = p->full + v * n;
        double sum = 0;

        rc = prune_draw(p, &s, d, h, r ? p->image : full, v, err);
        for (size_t i = 0; r && i < n; i++) {
            double e = fabs((double)p->image[i] - full[i]);

            sum += e * e;
            r->max_abs = fmax(r->max_abs, e);
        }
        if (r)
            r->psnr = fmin(r->psnr, -10 * log10(sum / (double)n + 1e-20));
    }
    splat_release(&s);
    sort_doubles(p->ms, VIEWS);
    *median = p->ms[VIEWS / 2];
    return rc;
}

/* Memory for meshes of V vertices and all pictures. */
static int prune_allocate(struct prune *p, size_t V, struct error *err)
{
    size_t pixels = p->size * p->size;

    p->verts = arena_take(&p->memory, POSES * 3 * V, sizeof *p->verts);
    p->full = arena_take(&p->memory, VIEWS * 3 * pixels, sizeof *p->full);
    p->image = arena_take(&p->memory, 3 * pixels, sizeof *p->image);
    p->ones = arena_take(&p->memory, pixels, sizeof *p->ones);
    p->weight = arena_take(&p->memory, p->b->N, sizeof *p->weight);
    p->max = arena_take(&p->memory, p->b->N, sizeof *p->max);
    if (arena_check(&p->memory, "the views", err))
        return -1;
    for (size_t i = 0; i < pixels; i++)
        p->ones[i] = 1;
    return baked_move_init(&p->move, p->b, err);
}

/* Gaussians of each branch. */
static void prune_count(size_t n[3], const struct baked *b)
{
    n[0] = n[1] = n[2] = 0;
    for (size_t i = 0; i < b->N; i++)
        n[b->branch[i]]++;
}

/* Draw all, keep what weighs enough, draw again and compare. */
int prune_views(struct baked *b, struct prune_report *r,
                const struct densify *d, const struct identity *id,
                size_t size, double eps, struct error *err)
{
    struct prune p = {.b = b, .size = size};
    struct head_motion open = {.jaw = {JAW_OPEN, 0, 0}}, rest = {0};
    uint8_t *keep = arena_take(&p.memory, b->N, sizeof *keep);
    int rc = -1;

    *r = (struct prune_report){.views = VIEWS, .psnr = INFINITY};
    if (prune_allocate(&p, id->head->V, err))
        goto out;
    head_pose(p.verts, id, &rest);
    head_pose(p.verts + 3 * id->head->V, id, &open);
    prune_count(r->before, b);
    if (prune_measure(&p, d, id->head, err) ||
        prune_draw_all(&p, d, id->head, NULL, &r->ms_full, err))
        goto out;
    for (size_t i = 0; i < b->N; i++)
        keep[i] = p.max[i] > 0 && p.max[i] >= eps;
    baked_keep(b, keep);
    prune_count(r->after, b);
    rc = prune_draw_all(&p, d, id->head, r, &r->ms_kept, err);
out:
    baked_move_release(&p.move);
    arena_release(&p.memory);
    return rc;
}
