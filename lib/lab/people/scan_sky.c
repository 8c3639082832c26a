/* From which directions of the sky a point of a resting head is seen, by
 * parallel projections with a depth buffer. */
#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/lab/people/scan.h"
#include "lib/lab/people/sun.h"
#include "lib/base/vec3.h"

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

/* Whether the map leaves a point free. */
static bool sky_is_free(const float *map, const struct raster_vertex *p)
{
    int x = (int)p->x, y = (int)p->y;

    return x < 0 || y < 0 || x >= MAP || y >= MAP
           || p->q + SLACK > map[y * MAP + x];
}

struct look {
    struct sun sun;
    float *bald, *map;
    struct raster_vertex *face, *worn;
};

/* Direction k of a piece: what it shuts off, and what it sees itself. */
static void sky_look_at_piece(struct look *l, struct piece *p, int k)
{
    uint64_t bit = (uint64_t)1 << k;

    for (size_t i = 0; i < p->nc; i++)
        l->worn[i] = sun_place(&l->sun, p->place + 3 * i);
    memset(l->map, 0, MAP * MAP * sizeof *l->map);
    sun_draw(l->map, MAP, l->worn, p->faces, p->nf, p->uv, &p->picture);
    for (int i = 0; i < FACE_VERTICES; i++)
        if (!sky_is_free(l->map, &l->face[i]))
            __atomic_fetch_or(&p->shade[i], bit, __ATOMIC_RELAXED);
    for (size_t i = 0; i < p->nc; i++)
        if (sky_is_free(l->map, &l->worn[i]) &&
            sky_is_free(l->bald, &l->worn[i]))
            __atomic_fetch_or(&p->seen[i], bit, __ATOMIC_RELAXED);
}

/* Direction k of everything. */
static void sky_look_along(struct look *l, struct scan_assets *a,
                           struct scan_rack *const rack[], int racks, int k)
{
    const struct scan_face *f = &a->face;
    uint64_t bit = (uint64_t)1 << k;

    sun_aim(&l->sun, sky[k], 1, MAP, REACH);
    for (int i = 0; i < FACE_VERTICES; i++)
        l->face[i] = sun_place(&l->sun, f->neutral + 3 * i);
    memset(l->bald, 0, MAP * MAP * sizeof *l->bald);
    for (size_t i = 0; i < f->nf; i++)      /* skin and neck are opaque */
        if (f->raw[3 * i] < FACE_NECK_END)
            sun_draw(l->bald, MAP, l->face, f->raw + 3 * i, 1, NULL, NULL);
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

/* One thread's maps, of pieces of up to `worn` corners. */
static struct look sky_look_take(struct arena *room, size_t worn)
{
    return (struct look){
        .bald = arena_take(room, MAP * MAP, sizeof(float)),
        .map = arena_take(room, MAP * MAP, sizeof(float)),
        .face = arena_take(room, FACE_VERTICES, sizeof(struct raster_vertex)),
        .worn = arena_take(room, worn, sizeof(struct raster_vertex))
    };
}

/* What is measured of a piece; the most corners that one has. */
static size_t sky_piece_take(struct piece *p, struct arena *memory, size_t max)
{
    p->seen = arena_take(memory, p->nc, sizeof *p->seen);
    p->shade = arena_take(memory, FACE_VERTICES, sizeof *p->shade);
    return p->nc > max ? p->nc : max;
}

int sky_measure(struct scan_assets *a, struct error *err)
{
    struct scan_rack *const rack[] = {&a->hair, &a->hat, &a->cloth};
    const size_t threads = (size_t)parallel_width();
    struct arena room = {0};
    struct look *look = arena_take(&room, threads, sizeof *look);
    size_t max = sky_piece_take(&a->torso, &a->memory, 0);

    for (int k = 0; k < SKY_DIRECTIONS; k++) {
        sky_make_direction(sky[k], k);
        sky_make_terms(sky_terms[k], sky[k]);
    }
    a->seen = arena_take(&a->memory, FACE_VERTICES, sizeof *a->seen);
    for (int r = 0; r < 3; r++)
        for (size_t i = 0; i < rack[r]->n; i++)
            max = sky_piece_take(&rack[r]->piece[i], &a->memory, max);
    for (size_t i = 0; look && i < threads; i++)
        look[i] = sky_look_take(&room, max);
    int rc = arena_check(&a->memory, "the sky", err) ||
             arena_check(&room, "the sky", err) ? -1 : 0;
    if (rc == 0)
        parallel_each(sky_measure_part, SKY_DIRECTIONS, 1, look, a, rack);
    arena_release(&room);
    return rc;
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
