/* What a plain figure looks like, by formulas: skin, brows, irises, a shirt,
 * and the rooms that light it. */
#include "lib/lab/people/scan.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/tri.h"
#include "lib/base/vec3.h"

#define N SKIN_SIZE
#define M SKIN_SLOW

void plain_uv(float uv[2], const float *p, float eye)
{
    uv[0] = 0.5f + 0.45f * atan2f(p[0], p[2] + 0.1f);
    uv[1] = 0.70f + 0.985f * (p[1] - eye);
}

/* ---- skin, brows, irises ------------------------------------------------ */

/* Faces of a region of the head into a mask of the square, softened. */
static void plain_draw_region(uint8_t *mask, const struct scan_assets *a,
                              int label)
{
    const struct scan_face *f = &a->face;
    struct raster_vertex s[3];
    struct tri t;
    int x0, x1;

    for (size_t i = 0; i < f->nf; i++) {
        int in = 0;

        for (int k = 0; k < 3; k++) {
            const float *uv = f->uv + 2 * f->faces[3 * i + (size_t)k];

            s[k] = (struct raster_vertex){uv[0] * N, (1 - uv[1]) * N, 1};
            in += a->label[f->raw[3 * i + (size_t)k]] == label;
        }
        if (in < 3 || !tri_setup(&t, &s[0], &s[1], &s[2], N, N))
            continue;
        for (int y = t.y0; y <= t.y1; y++)
            if (tri_row(&t, y, N, &x0, &x1))
                memset(mask + y * N + x0, 255, (size_t)(x1 - x0 + 1));
    }
}

/* Distance of a place of the square to the line through landmarks a to b. */
static float plain_line_distance(const struct scan_assets *a,
                                 const float at[2], int from, int to)
{
    const struct scan_face *f = &a->face;
    float best = 1, p[2], q[2];

    for (int k = from; k < to; k++) {
        plain_uv(p, f->neutral + 3 * f->landmark[k], f->eye[0][1]);
        plain_uv(q, f->neutral + 3 * f->landmark[k + 1], f->eye[0][1]);
        float d[2] = {q[0] - p[0], q[1] - p[1]};
        float e[2] = {at[0] - p[0], at[1] - p[1]};
        float t = clampf((d[0] * e[0] + d[1] * e[1])
                         / (d[0] * d[0] + d[1] * d[1] + 1e-9f), 0, 1);

        best = minf(best, hypotf(e[0] - t * d[0], e[1] - t * d[1]));
    }
    return best;
}

/* Slow colours: fair skin, red where blood is near, dark rows of lashes; the
 * looks of a person shift them. */
static void plain_make_mean(struct skin_model *s, const struct scan_assets *a)
{
    const float *fair = a->traits.plain_skin;

    for (int i = 0; i < M * M; i++) {
        float at[2] = {((float)(i % M) + 0.5f) / M,
                       1 - ((float)(i / M) + 0.5f) / M};
        float side = fabsf(at[0] - 0.5f), up = at[1];
        float cheek = expf(-40 * ((side - 0.19f) * (side - 0.19f)
                                  + (up - 0.54f) * (up - 0.54f)));
        float nose = expf(-160 * (side * side + (up - 0.53f) * (up - 0.53f)));
        float red = 0.5f * cheek + 0.6f * nose
                    + 0.12f * noise_sum(9 * at[0], 9 * up, 3, 3);
        float lash = minf(plain_line_distance(a, at, 36, 39),
                          plain_line_distance(a, at, 42, 45));
        float dark = 1.2f * ramp(0.012f, 0.003f, lash)
                     + 0.22f * ramp(0.05f, 0.01f, lash);

        for (int k = 0; k < 3; k++)
            s->mean[3 * i + k] = fair[k] - dark
                                 - 0.16f * red * (k ? 1 : 0.2f);
    }
}

/* Density of brows: hair along the landmarks' arcs, thinner outwards. */
static void plain_make_brows(struct brow_model *b, const struct scan_assets *a)
{
    for (int y = 0; y < BROW_H; y++)
        for (int x = 0; x < BROW_W; x++) {
            float at[2] = {(float)(BROW_X + x) / N,
                           1.03f - (float)(BROW_Y + y) / N};
            float d = plain_line_distance(a, at, 17, 20);
            float thick = lerpf(0.010f, 0.026f, (float)x / BROW_W);

            b->mean[y * BROW_W + x] = ramp(1.3f, 0.3f, d / thick);
        }
}

static int plain_make_skin(struct skin_model *s, const struct scan_assets *a,
                           struct arena *memory, struct error *err)
{
    s->people = 1;
    s->mean = arena_take(memory, 3 * M * M, sizeof *s->mean);
    s->grain = arena_take(memory, N * N, 1);
    s->crease = arena_take(memory, N * N, sizeof *s->crease);
    s->lip = arena_take(memory, N * N, 1);
    s->mouth = arena_take(memory, N * N, 1);
    s->beard = arena_take(memory, N * N, 1);
    s->brows.mean = arena_take(memory, BROW_PLANE, sizeof *s->brows.mean);
    if (arena_check(memory, "a figure", err))
        return -1;
    plain_draw_region(s->lip, a, LABEL_LIP);
    for (int i = 0; i < N * N; i++) {
        float side = fabsf((float)(i % N) / N - 0.5f), y = (float)(i / N) / N;
        float cheek = lerpf(0.66f, 0.46f, ramp(0.14f, 0.34f, side));
        float lip = ramp(0.13f, 0.09f, side) * ramp(0.555f, 0.575f, y);

        s->grain[i] = (int8_t)clampf(5 * noise_sum(0.23f * (float)(i % N),
                                                   0.23f * (float)(i / N), 1,
                                                   2), -127, 127);
        s->beard[i] = s->lip[i] ? 0 : (uint8_t)
            (255 * maxf(ramp(cheek - 0.03f, cheek + 0.03f, y), lip)
             * ramp(0.92f, 0.84f, y) * ramp(0.42f, 0.36f, side));
    }
    plain_make_mean(s, a);
    plain_make_brows(&s->brows, a);
    return 0;
}

/* Iris of a colour with its pupil, on white, as MakeHuman's pictures lie. */
static void plain_make_iris(struct bitmap *b, const float color[3],
                            struct arena *memory)
{
    enum { SIDE = 256 };

    b->w = b->h = SIDE;
    b->rgba = arena_take(memory, SIDE * SIDE, 4);
    for (int i = 0; b->rgba && i < SIDE * SIDE; i++) {
        float u = ((float)(i % SIDE) + 0.5f) / SIDE - 0.70f;
        float v = 1 - ((float)(i / SIDE) + 0.5f) / SIDE - 0.70f;
        float r = hypotf(u, v) / 0.115f, t = atan2f(v, u);
        float ray = 1 + 0.35f * noise_sum(9 * cosf(t) + 20, 9 * sinf(t) + 20,
                                          1.5f * r, 2);
        float white[3] = {0.90f, 0.86f, 0.84f}, c[3];

        for (int k = 0; k < 3; k++)
            c[k] = color[k] * ray * ramp(0.26f, 0.34f, r);
        lerp3(c, c, white, ramp(0.93f, 1.05f, r));
        for (int k = 0; k < 3; k++)
            b->rgba[4 * i + k] = (uint8_t)(255 * clampf(c[k], 0, 1));
        b->rgba[4 * i + 3] = 255;
    }
}

/* ---- clothes and light -------------------------------------------------- */

/* A shirt: rings from the collar over the shoulders down; height, half width,
 * half depth, middle. */
static const float shirt[][4] = {
    {-0.70f, 0.33f, 0.34f, -0.16f}, {-0.78f, 0.37f, 0.36f, -0.17f},
    {-0.83f, 0.50f, 0.39f, -0.18f}, {-0.90f, 0.72f, 0.42f, -0.20f},
    {-1.00f, 0.92f, 0.45f, -0.20f}, {-1.16f, 1.04f, 0.50f, -0.19f},
    {-1.60f, 1.10f, 0.56f, -0.16f}, {-2.60f, 1.10f, 0.60f, -0.14f}
};

static int plain_make_shirt(struct scan_assets *a, struct error *err)
{
    enum { SIDES = 48, RINGS = sizeof shirt / sizeof *shirt };
    float place[3 * SIDES * RINGS];
    int32_t faces[6 * SIDES * (RINGS - 1)];
    size_t n = 0;

    for (int k = 0; k < RINGS; k++)
        for (int s = 0; s < SIDES; s++) {
            float t = 2 * PI_F * (float)s / SIDES;
            float *o = place + 3 * (k * SIDES + s);

            o[0] = shirt[k][1] * sinf(t);
            /* a collar is lower in front */
            o[1] = shirt[k][0] - (k < 3 ? 0.10f * ramp(-0.2f, 1, cosf(t)) : 0);
            o[2] = shirt[k][3] + shirt[k][2] * cosf(t);
        }
    for (int k = 0; k + 1 < RINGS; k++)
        for (int s = 0; s < SIDES; s++) {
            int32_t i = k * SIDES + s, j = k * SIDES + (s + 1) % SIDES;
            int32_t two[6] = {i, i + SIDES, j, j, i + SIDES, j + SIDES};

            memcpy(faces + n, two, sizeof two);
            n += 6;
        }
    a->cloth.n = 1;
    return piece_make(&a->cloth.piece[0], &a->body, place, SIDES * RINGS, faces,
                      n / 3, -9, &a->memory, err);
}

enum { ROOM_W = 256, ROOM_H = 128 };

/* A room (ROOM_H,ROOM_W,3): walls, floor, things along them, a window and a
 * lamp. */
static void plain_make_room(float *rgb, uint64_t seed)
{
    enum { W = ROOM_W, H = ROOM_H };
    float wall[3], box[2][3];
    struct random r;

    random_init(&r, seed, "room");
    for (int k = 0; k < 3; k++)
        wall[k] = random_float(&r, 0.25, 0.6);
    for (int k = 0; k < 2; k++) {
        box[k][0] = random_float(&r, 0, W);
        box[k][1] = H * (k ? random_float(&r, 0.12, 0.3)
                           : random_float(&r, 0.3, 0.42));
        box[k][2] = k ? 5 : 14;
    }
    for (int i = 0; i < W * H; i++) {
        float x = (float)(i % W), y = (float)(i / W), t = 2 * PI_F * x / W;
        float up = ramp(0.75f, 0.25f, y / H);
        float thing = noise_sum(2.5f * cosf(t) + (float)seed, 2.5f * sinf(t),
                                5 * y / H, 3);
        float dim = 0.35f + 0.75f * up + 0.35f * thing;

        for (int k = 0; k < 3; k++)
            rgb[3 * i + k] = maxf(0.02f, wall[k] * dim
                + 0.08f * noise_sum(3 * cosf(t), 3 * sinf(t) + 9 * (float)k,
                                    4 * y / H + (float)seed, 2));
        for (int k = 0; k < 2; k++) {
            float dx = fabsf(fmodf(x - box[k][0] + 1.5f * W, W) - 0.5f * W);
            float in = ramp(1.1f, 0.9f, dx / box[k][2])
                       * ramp(1.1f, 0.9f, fabsf(y - box[k][1]) / box[k][2]);
            static const float glow[2][3] = {{9, 10, 11}, {36, 30, 22}};

            mad3(rgb + 3 * i, rgb + 3 * i, glow[k], in);
        }
    }
}

int plain_make_looks(struct scan_assets *a, struct error *err)
{
    enum { IRISES = 3, ROOMS = 4 };
    struct arena *memory = &a->memory;
    float *room = arena_take(memory, 3 * ROOM_W, ROOM_H * sizeof *room);

    a->light = arena_take(memory, ROOMS, sizeof *a->light);
    if (plain_make_skin(&a->skin, a, memory, err))
        return -1;
    for (; a->niris < IRISES; a->niris++)
        plain_make_iris(&a->iris[a->niris], a->traits.plain_iris[a->niris],
                        memory);
    for (; a->nlight < ROOMS; a->nlight++) {
        plain_make_room(room, a->nlight + 1);
        if (light_map_make(&a->light[a->nlight], room, ROOM_W, ROOM_H, memory,
                           err))
            return -1;
    }
    return plain_make_shirt(a, err);
}
