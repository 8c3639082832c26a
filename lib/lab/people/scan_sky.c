/* From which directions of the sky a point of a resting head is seen, by
 * parallel projections with a depth buffer. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/lab/people/scan.h"
#include "lib/lab/people/tri.h"
#include "lib/lab/people/vec.h"

#define MAP 176                 /* side of a depth map */
#define REACH 1.15f             /* head units, half of what it covers */
#define SLACK 0.018f            /* head units that a point may lie deeper */

#define SKY_MOMENTS 12          /* 10, and two that stay 0 */

static float sky[SKY_DIRECTIONS][3];
static float sky_terms[SKY_DIRECTIONS][SKY_MOMENTS];    /* harmonic2_moments */

/* Evenly over the sphere: a golden spiral. */
static void sky_make_direction(float d[3], int k)
{
    float y = 1 - 2 * ((float)k + 0.5f) / SKY_DIRECTIONS;
    float r = sqrtf(1 - y * y), t = 2.39996323f * (float)k;

    d[0] = r * cosf(t);
    d[1] = y;
    d[2] = r * sinf(t);
}

/* What moments multiply by for light from d. */
static void sky_make_terms(float o[SKY_MOMENTS], const float d[3])
{
    o[0] = 1;
    for (int j = 0; j < 3; j++) {
        o[1 + j] = d[j];
        o[4 + j] = d[j] * d[j] - 1 / 3.0f;
    }
    o[7] = d[0] * d[1];
    o[8] = d[0] * d[2];
    o[9] = d[1] * d[2];
}

void sky_direction(float d[3], int k)
{
    copy3(d, sky[k]);
}

struct view {
    float u[3], v[3], w[3];
};

/* Axes of a parallel projection along direction k. */
static void sky_view_make(struct view *o, int k)
{
    float up[3] = {0, 1, 0};

    sky_direction(o->w, k);
    if (fabsf(o->w[1]) > 0.95f)
        up[0] = 1, up[1] = 0;
    cross3(o->u, up, o->w);
    unit3(o->u);
    cross3(o->v, o->w, o->u);
}

static struct raster_vertex sky_view_place(const struct view *o,
                                           const float p[3])
{
    return (struct raster_vertex){
        (dot3(p, o->u) / REACH + 1) * (0.5f * MAP),
        (dot3(p, o->v) / REACH + 1) * (0.5f * MAP), dot3(p, o->w) + 8
    };
}

/* Faces into a depth map; texels whose alpha is low are holes. */
static void sky_draw_depth(float *map, const struct raster_vertex *at,
                           const int32_t *faces, size_t nf, const float *uv,
                           const struct bitmap *picture)
{
    for (size_t i = 0; i < nf; i++) {
        const int32_t *v = faces + 3 * i;
        struct tri t;
        int x0, x1;
        if (!tri_setup(&t, &at[v[0]], &at[v[1]], &at[v[2]], MAP, MAP))
            continue;
        for (int y = t.y0; y <= t.y1; y++) {
            if (!tri_row(&t, y, MAP, &x0, &x1))
                continue;
            for (int x = x0; x <= x1; x++) {
                float w[3], q = tri_at(w, &t, x, y), c[4];
                if (q <= map[y * MAP + x])
                    continue;
                if (picture && picture->rgba) {
                    bitmap_sample(c, picture,
                                  w[0] * uv[2 * v[0]] + w[1] * uv[2 * v[1]]
                                  + w[2] * uv[2 * v[2]],
                                  w[0] * uv[2 * v[0] + 1]
                                  + w[1] * uv[2 * v[1] + 1]
                                  + w[2] * uv[2 * v[2] + 1]);
                    if (c[3] < 0.5f)
                        continue;
                }
                map[y * MAP + x] = q;
            }
        }
    }
}

/* Whether the map leaves a point free. */
static bool sky_is_free(const float *map, const struct raster_vertex *p)
{
    int x = (int)p->x, y = (int)p->y;

    return x < 0 || y < 0 || x >= MAP || y >= MAP
           || p->q + SLACK > map[y * MAP + x];
}

struct look {
    struct view view;
    float *bald, *map;
    struct raster_vertex *face, *worn;
};

static int sky_look_init(struct look *l, size_t worn)
{
    l->bald = malloc(MAP * MAP * sizeof *l->bald);
    l->map = malloc(MAP * MAP * sizeof *l->map);
    l->face = malloc(FACE_VERTICES * sizeof *l->face);
    l->worn = malloc((worn + 1) * sizeof *l->worn);
    return l->bald && l->map && l->face && l->worn ? 0 : -1;
}

static void sky_look_release(struct look *l)
{
    free(l->bald);
    free(l->map);
    free(l->face);
    free(l->worn);
}

/* Direction k of a piece: what it shuts off, and what it sees itself. */
static void sky_look_at_piece(struct look *l, struct piece *p, int k)
{
    uint64_t bit = (uint64_t)1 << k;

    for (size_t i = 0; i < p->nc; i++)
        l->worn[i] = sky_view_place(&l->view, p->place + 3 * i);
    memset(l->map, 0, MAP * MAP * sizeof *l->map);
    sky_draw_depth(l->map, l->worn, p->faces, p->nf, p->uv, &p->picture);
    for (int i = 0; i < FACE_VERTICES; i++)
        if (!sky_is_free(l->map, &l->face[i]))
            __atomic_fetch_or(&p->shade[i], bit, __ATOMIC_RELAXED);
    for (size_t i = 0; i < p->nc; i++)
        if (sky_is_free(l->map, &l->worn[i]) &&
            sky_is_free(l->bald, &l->worn[i]))
            __atomic_fetch_or(&p->seen[i], bit, __ATOMIC_RELAXED);
}

static int sky_piece_room(struct piece *p)
{
    p->seen = calloc(p->nc + 1, sizeof *p->seen);
    p->shade = calloc(FACE_VERTICES, sizeof *p->shade);
    return p->seen && p->shade ? 0 : -1;
}

/* Direction k of everything. */
static void sky_look_along(struct look *l, struct scan_assets *a,
                           struct scan_rack *const rack[], int racks, int k)
{
    const struct scan_face *f = &a->face;
    uint64_t bit = (uint64_t)1 << k;

    sky_view_make(&l->view, k);
    for (int i = 0; i < FACE_VERTICES; i++)
        l->face[i] = sky_view_place(&l->view, f->neutral + 3 * i);
    memset(l->bald, 0, MAP * MAP * sizeof *l->bald);
    for (size_t i = 0; i < f->nf; i++)      /* skin and neck are opaque */
        if (f->raw[3 * i] < FACE_NECK_END)
            sky_draw_depth(l->bald, l->face, f->raw + 3 * i, 1, NULL, NULL);
    for (int i = 0; i < FACE_VERTICES; i++)
        if (sky_is_free(l->bald, &l->face[i]))
            __atomic_fetch_or(&a->seen[i], bit, __ATOMIC_RELAXED);
    for (int r = 0; r < racks; r++)
        for (size_t i = 0; i < rack[r]->n; i++)
            sky_look_at_piece(l, &rack[r]->piece[i], k);
    sky_look_at_piece(l, &a->torso, k);
}

/* Direction k; look (parallel_width()). */
PARALLEL(sky_measure_part, k, struct look *, look, struct scan_assets *, a,
         struct scan_rack *const *, rack)
{
    sky_look_along(&look[parallel_slot()], a, rack, 3, (int)k);
}

int sky_measure(struct scan_assets *a, struct error *err)
{
    struct scan_rack *const rack[] = {&a->hair, &a->hat, &a->cloth};
    size_t max = a->torso.nc;
    bool failed = false;

    for (int k = 0; k < SKY_DIRECTIONS; k++) {
        sky_make_direction(sky[k], k);
        sky_make_terms(sky_terms[k], sky[k]);
    }
    a->seen = calloc(FACE_VERTICES, sizeof *a->seen);
    failed = !a->seen || sky_piece_room(&a->torso);
    for (int r = 0; r < 3; r++)
        for (size_t i = 0; i < rack[r]->n; i++) {
            struct piece *p = &rack[r]->piece[i];
            failed = failed || sky_piece_room(p);
            max = p->nc > max ? p->nc : max;
        }
    const size_t threads = (size_t)parallel_width();
    struct look *look = calloc(threads, sizeof *look);
    failed = failed || !look;
    for (size_t i = 0; look && i < threads; i++)
        failed = sky_look_init(&look[i], max) || failed;
    if (!failed)
        parallel_each(sky_measure_part, SKY_DIRECTIONS, 1, look, a, rack);
    for (size_t i = 0; look && i < threads; i++)
        sky_look_release(&look[i]);
    free(look);
    return failed ? error_set(err, EX_OSERR, "out of memory for the sky") : 0;
}

void sky_moments(float m[10], uint64_t mask, const float n[3])
{
    float sum[SKY_MOMENTS] = {0};

    for (; mask; mask &= mask - 1) {
        const int k = __builtin_ctzll(mask);
        const float c = dot3(sky[k], n) * (4.0f / SKY_DIRECTIONS);

        for (int j = 0; c > 0 && j < SKY_MOMENTS; j++)
            sum[j] += c * sky_terms[k][j];
    }
    memcpy(m, sum, 10 * sizeof *m);
}
