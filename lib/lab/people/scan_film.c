/* Linear light to encoded bytes: background, exposure, optics, grain, codec. */
#include "lib/lab/people/scan_film.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/codec.h"
#include "lib/lab/people/lens.h"
#include "lib/lab/people/noise.h"
#include "lib/base/vec3.h"

int scan_film_init(struct scan_film *f, int size, struct error *err)
{
    size_t n = (size_t)size * (size_t)size;

    *f = (struct scan_film){.size = size};
    f->layer = arena_take(&f->memory, 8 * n, sizeof *f->layer);
    f->wall = arena_take(&f->memory, 3 * n, sizeof *f->wall);
    f->tmp = arena_take(&f->memory, 3 * n, sizeof *f->tmp);
    return arena_check(&f->memory, "a picture", err);
}

void scan_film_release(struct scan_film *f)
{
    arena_release(&f->memory);
}

/* ---- background --------------------------------------------------------- */

/* Half the width of a disc of radius r, v rows from its middle. */
static int film_disc(int r, int v)
{
    return (int)sqrtf((float)(r * r - v * v) + 0.5f);
}

/* Mean over the disc about (x, y), of what lies in the plane. */
static float film_defocus_end(const float *in, int n, int r, int x, int y)
{
    float sum = 0;
    int count = 0;

    for (int v = -r; v <= r; v++) {
        int half = film_disc(r, v);
        int row = y + v < 0 ? 0 : y + v >= n ? n - 1 : y + v;
        int a = x - half < 0 ? 0 : x - half;
        int b = x + half >= n ? n - 1 : x + half;
        for (int u = a; u <= b; u++)
            sum += in[row * n + u];
        count += b - a + 1;
    }
    return sum / (float)count;
}

/* Mean over a disc of radius r pixels, of one plane: of a row's pixels at once,
 * but for those whose disc reaches past an end. */
static void film_defocus(float *restrict out, const float *restrict in,
                         int n, int r)
{
    const int edge = r < (n + 1) / 2 ? r : (n + 1) / 2;
    int count = 0;

    for (int v = -r; v <= r; v++)
        count += 2 * film_disc(r, v) + 1;
    for (int y = 0; y < n; y++) {
        float *to = out + y * n;

        for (int x = 0; x < edge; x++) {
            to[x] = film_defocus_end(in, n, r, x, y);
            to[n - 1 - x] = film_defocus_end(in, n, r, n - 1 - x, y);
        }
        for (int x = edge; x < n - edge; x++)
            to[x] = 0;
        for (int v = -r; v <= r; v++) {
            const int half = film_disc(r, v);
            const int row = y + v < 0 ? 0 : y + v >= n ? n - 1 : y + v;

            for (int u = -half; u <= half; u++)
                for (int x = edge; x < n - edge; x++)
                    to[x] += in[row * n + x + u];
        }
        for (int x = edge; x < n - edge; x++)
            to[x] /= (float)count;
    }
}

/* A wall: one colour in the light that falls on it, with a slope. */
static void film_paint_wall(float *wall, const struct figure *f, int n)
{
    const struct scan_camera *c = &f->look.camera;
    const struct light *l = &f->light;
    float to[3] = {0, 0, -1}, e[3];
    uint64_t key = random_mix(f->look.key ^ 0x77616c6c);
    float sx = (float)(key & 1023) / 1023 - 0.5f;
    float sy = (float)(key >> 10 & 1023) / 1023 - 0.5f;

    for (int k = 0; k < 3; k++) {
        e[k] = maxf(harmonic2_diffuse(&l->sky[k], to), 0.05f);
        for (int i = 0; i < l->nlamp; i++)
            e[k] += l->lamp[i].rgb[k] * 0.318f
                    * maxf(dot3(l->lamp[i].dir, to), 0.1f);
    }
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float u = (float)x / (float)n - 0.5f, v = (float)y / (float)n
                      - 0.5f;
            float g = 1 + 0.9f * (sx * u + sy * v)
                      + 0.05f * noise_sum(3 * u + 9 * sx, 3 * v, 2, 3);
            for (int k = 0; k < 3; k++)
                wall[(k * n + y) * n + x] = c->wall[k] * e[k]
                                            * maxf(g, 0.1f);
        }
}

void scan_backdrop(float *wall, float *tmp, const struct figure *f, int n)
{
    const struct scan_camera *c = &f->look.camera;
    int r = (int)(c->depth * 0.035f * (float)n);
    size_t plane = (size_t)n * (size_t)n;

    if (c->backdrop == BACKDROP_WALL) {
        film_paint_wall(wall, f, n);
        return;
    }
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float t = 2 * tanf(0.5f * c->view), rgb[3];
            float d[3] = {((float)x / (float)n - 0.5f) * t,
                          ((float)y / (float)n - 0.5f) * t + c->tilt, 1};
            light_mirror(rgb, &f->light, d, 0);
            for (int k = 0; k < 3; k++)
                wall[((size_t)k * plane) + (size_t)(y * n + x)]
                    = minf(rgb[k], 14 / f->exposure);
        }
    if (r < 1)
        return;
    for (int k = 0; k < 3; k++) {
        memcpy(tmp, wall + (size_t)k * plane, plane * sizeof *tmp);
        film_defocus(wall + (size_t)k * plane, tmp, n, r);
    }
}

/* ---- tone --------------------------------------------------------------- */

/* Highlights roll off instead of clipping. */
static float film_shoulder(float x)
{
    return x < 0.5f ? x : 0.5f + 0.5f * (1 - 1 / (1 + (x - 0.5f) * 2));
}

/* Encoded value of linear x within 0.001, by interpolation in a table of
 * square roots. */
static float film_encode(const float *table, float x)
{
    float r = 512 * sqrtf(clampf(x, 0, 1));
    int i = (int)r;

    return lerpf(table[i], table[i + 1], r - (float)i);
}

struct tone {
    float gain[3], contrast, saturation, table[514];
};

/* The curve as a table, and exposure as it wanders with time. */
static void film_tone_init(struct tone *t, const struct figure *f, double time)
{
    const struct scan_camera *c = &f->look.camera;
    float phase = (float)(f->look.key & 255);

    for (int i = 0; i < 514; i++) {
        float x = (float)i * (float)i / (512.0f * 512.0f);
        t->table[i] = x <= 0.0031308f ? 12.92f * x
                      : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
    }
    for (int k = 0; k < 3; k++)
        t->gain[k] = f->exposure
                     * (1 + c->drift * (0.10f * sinf(1.1f * (float)time
                                                     + phase)
                                        + 0.04f * sinf(0.7f * (float)time
                                                       + phase
                                                       + 2 * (float)k)));
    t->contrast = c->contrast;
    t->saturation = c->saturation;
}

/* Gain, shoulder, encoding, saturation and contrast, in place. */
static void film_tone_apply(float c[3], const struct tone *t, float vignette)
{
    float gray;

    for (int k = 0; k < 3; k++)
        c[k] = film_encode(t->table, film_shoulder(maxf(c[k], 0) * t->gain[k]
                                                   * vignette));
    gray = 0.30f * c[0] + 0.59f * c[1] + 0.11f * c[2];
    for (int k = 0; k < 3; k++) {
        float v = gray + (c[k] - gray) * t->saturation;
        c[k] = clampf(0.42f + (v - 0.42f) * t->contrast, 0, 1);
    }
}

/* The stage and the wall into encoded planes, person and front premultiplied
 * by their cover. */
static void film_develop(struct scan_film *film, const struct scan_stage *s,
                         const float *wall, const struct tone *t)
{
    const struct scan_camera *cam = &s->figure->look.camera;
    size_t n = (size_t)film->size * (size_t)film->size;
    float half = 0.5f * (float)film->size;

    for (size_t i = 0; i < n; i++) {
        float c[3], x = (float)(i % (size_t)film->size) / half - 1;
        float y = (float)(i / (size_t)film->size) / half - 1;
        float dim = 1 - 0.35f * cam->vignette * (x * x + y * y);
        for (int front = 0; front < 2; front++) {
            const float *light = front ? s->front : s->light;
            float a = front ? s->block[i] : s->alpha[i];
            float *o = film->layer + (front ? 4 * n : 0);
            for (int k = 0; k < 3; k++)
                c[k] = a > 0 ? light[3 * i + (size_t)k] / a : 0;
            if (a > 0)
                film_tone_apply(c, t, dim);
            for (size_t k = 0; k < 3; k++)
                o[k * n + i] = c[k] * a;
            o[3 * n + i] = a;
        }
        for (size_t k = 0; k < 3; k++)
            c[k] = wall[k * n + i];
        film_tone_apply(c, t, dim);
        for (size_t k = 0; k < 3; k++)
            film->wall[k * n + i] = c[k];
    }
}

/* ---- optics, plane by plane --------------------------------------------- */

/* What the lens and the shutter do: smeared by motion, softened, coarse. */
static void film_optics(float *p, float *tmp, int n,
                        const struct scan_camera *c, const float move[2])
{
    float blur = (0.40f + c->blur) * (float)n / 256;

    if (fabsf(move[0]) + fabsf(move[1]) > 0.7f)
        lens_smear(p, tmp, n, move[0], move[1]);
    if (blur > 0.3f)
        lens_soften(p, tmp, n, blur);
    if (c->low < 0.95f)
        lens_coarsen(p, tmp, n, c->low);
}

/* p += amount (p - its blur): what cameras do to their pictures. */
static void film_sharpen(float *p, float *tmp, float *tmp2, int n, float amount)
{
    size_t m = (size_t)n * (size_t)n;

    memcpy(tmp, p, m * sizeof *p);
    lens_soften(tmp, tmp2, n, (float)n / 256);
    for (size_t i = 0; i < m; i++)
        p[i] += amount * (p[i] - tmp[i]);
}

/* ---- the print ---------------------------------------------------------- */

static uint8_t film_byte_of(float v)
{
    return (uint8_t)(clampf(v, 0, 1) * 255 + 0.5f);
}

/* rgb = person + front + what they leave of the wall, with noise. */
static void film_compose(const struct scan_print *out,
                         const struct scan_film *f, const struct scan_stage *s,
                         uint64_t frame)
{
    const struct scan_person *p = &s->figure->look;
    size_t n = (size_t)f->size * (size_t)f->size;
    uint64_t key = random_mix(p->key ^ random_mix(frame + 0x6e6f));

    for (size_t i = 0; i < n; i++) {
        uint64_t h = random_mix(key + i);
        for (size_t k = 0; k < 3; k++) {
            float person = f->layer[k * n + i];
            float v = person + f->layer[(4 + k) * n + i]
                      + f->wall[k * n + i];
            out->person[3 * i + k] = film_byte_of(person);
            v = lens_grain(v, (int)k, h, p->camera.noise);
            out->rgb[3 * i + k] = film_byte_of(v);
        }
        out->mask[i] = film_byte_of(f->layer[3 * n + i]);
        out->label[i] = f->layer[7 * n + i] > 0.02f ? LABEL_OCCLUDER
                                                    : s->tag[i];
    }
}

void scan_expose(const struct scan_print *out, struct scan_film *f,
                 const struct scan_stage *s, const float *wall,
                 uint64_t frame, double time, const float move[2])
{
    static const float still[2] = {0, 0};
    const struct scan_camera *c = &s->figure->look.camera;
    size_t n = (size_t)f->size * (size_t)f->size;
    bool front = s->figure->look.front != FRONT_NONE;
    struct tone t;

    film_tone_init(&t, s->figure, time);
    film_develop(f, s, wall, &t);
    for (size_t k = 0; k < (front ? 8u : 4u); k++)
        film_optics(f->layer + k * n, f->tmp, f->size, c, move);
    for (size_t k = 0; k < 3; k++) {
        film_optics(f->wall + k * n, f->tmp, f->size, c, still);
        for (size_t i = 0; i < n; i++)
            f->wall[k * n + i] *= 1 - f->layer[3 * n + i]
                                  - f->layer[7 * n + i];
    }
    for (size_t k = 0; c->sharpen > 0 && k < 3; k++) {
        film_sharpen(f->layer + k * n, f->tmp, f->tmp + n, f->size, c->sharpen);
        film_sharpen(f->layer + (4 + k) * n, f->tmp, f->tmp + n, f->size,
                     c->sharpen);
        film_sharpen(f->wall + k * n, f->tmp, f->tmp + n, f->size, c->sharpen);
    }
    film_compose(out, f, s, frame);
    if (c->codec)
        codec_damage(out->rgb, f->tmp, f->size, c->codec);
    else if (c->jpeg)
        jpeg_damage(out->rgb, f->tmp, f->size, c->jpeg);
}
