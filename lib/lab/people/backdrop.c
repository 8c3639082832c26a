/* Backgrounds: walls, gradients, blurred rooms, gardens, shelves. */
#include "lib/lab/people/lens.h"

#include <math.h>

#include "lib/base/random.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/vec.h"

/* A plain wall, lit from one side. */
static void backdrop_wall_at(float c[3], const struct persona *p, float u,
                             float v)
{
    float s = p->skin.shift[0];
    float n = noise_sum(u * 1.5f + s, v * 1.5f, 3, 2);
    float f = 0.75f + 0.25f * u * (p->yaw > 0 ? 1 : -1) - 0.1f * v + 0.05f * n;

    for (int k = 0; k < 3; k++)
        c[k] = p->wall[k] * f;
}

/* Discs of light out of focus over a dark or bright room. */
static void backdrop_bokeh_at(float c[3], const struct persona *p, float u,
                              float v)
{
    float s = p->skin.shift[1];

    for (int k = 0; k < 3; k++)
        c[k] = p->wall[k] * (0.40f + 0.28f * noise_sum(u + s, v, 1, 2)
                             + 0.07f * noise_sum(u, v + s, (float)k, 1));
    for (int i = 0; i < 14; i++) {
        uint64_t h = random_mix(p->key + (uint64_t)i * 31);
        float x = (float)(h & 1023) / 512 - 1, y = (float)(h >> 10 & 1023) / 512
                  - 1;
        float r = 0.06f + 0.16f * (float)(h >> 20 & 255) / 255;
        float d = hypotf(u - x, v - y) / r;
        float g = ramp(1.1f, 0.85f, d) * (0.3f + 0.5f * ramp(0.2f, 1, d));
        for (int k = 0; k < 3; k++)
            c[k] += g * lerpf(p->accent[k], p->wall[k],
                              (float)(h >> 30 & 255) / 255) * 0.8f;
    }
}

/* Leaves: many octaves of greenish noise, soft. */
static void backdrop_garden_at(float c[3], const struct persona *p, float u,
                               float v)
{
    float s = p->skin.shift[2], n = noise_sum(u * 3 + s, v * 3, 1, 4);
    float sky = ramp(0.1f, -0.8f, v + 0.3f * n);
    float green[3] = { 0.10f + 0.08f * n, 0.18f + 0.13f * n,
                       0.05f + 0.03f * n };
    float blue[3] = { 0.50f, 0.66f, 0.85f };

    for (int k = 0; k < 3; k++)
        c[k] = lerpf(fmaxf(green[k], 0.01f), blue[k], sky);
}

/* A room: window, door frame and furniture as soft boxes. */
static void backdrop_room_at(float c[3], const struct persona *p, float u,
                             float v)
{
    backdrop_wall_at(c, p, u, v);
    for (int i = 0; i < 7; i++) {
        uint64_t h = random_mix(p->key + 977 + (uint64_t)i * 13);
        float x = (float)(h & 1023) / 512 - 1, y = (float)(h >> 10 & 1023) / 512
                  - 1;
        float w = 0.08f + 0.35f * (float)(h >> 20 & 255) / 255;
        float t = 0.08f + 0.5f * (float)(h >> 28 & 255) / 255;
        float soft = 0.03f + 0.05f * p->age;
        float in = ramp(w + soft, w - soft, fabsf(u - x))
                   * ramp(t + soft, t - soft, fabsf(v - y));
        float f = (float)(h >> 36 & 255) / 255;
        for (int k = 0; k < 3; k++)
            c[k] = lerpf(c[k], lerpf(p->accent[k], p->wall[k], f)
                               * (0.35f + 1.1f * (float)(h >> 44 & 255) / 255),
                         in * 0.9f);
    }
}

/* Shelves of books. */
static void backdrop_shelf_at(float c[3], const struct persona *p, float u,
                              float v)
{
    float rows = 4, y = (v + 1.3f) * rows * 0.5f, row = floorf(y);
    float x = u * 11 + row * 3.7f, book = floorf(x), fx = x - book;
    uint64_t h = random_mix(p->key ^ (uint64_t)((int)book * 64 + (int)row));
    float top = 0.12f + 0.25f * (float)(h & 255) / 255;
    float in = ramp(0.02f, 0.15f, fx) * ramp(0.98f, 0.85f, fx)
               * ramp(top - 0.06f, top + 0.06f, y - row)
               * ramp(0.97f, 0.88f, y - row);

    for (int k = 0; k < 3; k++) {
        float b = lerpf(p->wall[k], p->accent[k],
                        (float)(h >> 8 & 255) / 255)
                  * (0.2f + 0.8f * (float)(h >> (16 + 8 * k) & 255) / 255);
        c[k] = lerpf(0.05f + 0.15f * p->wall[k], b, in);
    }
}

void backdrop_paint(float *wall, const struct persona *p, int n)
{
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float u = 2 * ((float)x + 0.5f) / (float)n - 1;
            float v = 2 * ((float)y + 0.5f) / (float)n - 1;
            float *c = wall + 3 * (y * n + x);
            switch (p->backdrop) {
            case SCENERY_BOKEH: backdrop_bokeh_at(c, p, u, v); break;
            case SCENERY_GARDEN: backdrop_garden_at(c, p, u, v); break;
            case SCENERY_ROOM: backdrop_room_at(c, p, u, v); break;
            case SCENERY_SHELF: backdrop_shelf_at(c, p, u, v); break;
            case SCENERY_WALL:
            case SCENERY_WALL_TOO:
            case SCENERIES: backdrop_wall_at(c, p, u, v);
            }
            for (int k = 0; k < 3; k++)
                c[k] = fmaxf(c[k], 0);
        }
}
