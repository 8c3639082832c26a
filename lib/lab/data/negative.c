/* What a tracker's crop shows when it has lost its face: another place of the
 * picture, a face too large or small, one lying down.  Each is drawn from a
 * person's own pictures, as often as the others. */
#include "lib/lab/data/negative.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"

#define N ((size_t)CROP_NET)
#define WIDE ((size_t)320)      /* holds a crop at every angle */
#define DEGREE (M_PI / 180)

/* The crop moved by `far` of its side in some direction. */
static void negative_move(struct square *q, double far, struct random *r)
{
    double angle = random_range(r, 0, 2 * M_PI);

    q->x += far * cos(angle) * q->size;
    q->y += far * sin(angle) * q->size;
}

/* Any square that a search looks at (lib/track/search.c). */
static void negative_anywhere(struct square *q, const struct data_frame *f,
                              struct random *r)
{
    q->size = (double)f->height * exp(random_range(r, log(0.08), log(1.25)));
    q->x = (double)f->width * random_uniform(r);
    q->y = (double)f->height * random_uniform(r);
}

/* Where the crop lies, and how far it is turned. */
static double negative_place(struct square *q, const struct data_frame *f,
                             enum negative how, float jitter,
                             struct random *r)
{
    double upright = 10 * DEGREE * random_normal(r);

    *q = data_jitter(f, jitter, r);
    switch (how) {
    case NEGATIVE_MISSED:
        q->size *= exp(random_range(r, -0.6, 0.5));
        negative_move(q, random_range(r, 0.75, 1.5), r);
        return random_range(r, -M_PI, M_PI);
    case NEGATIVE_HALF:
        negative_move(q, random_range(r, 0.42, 0.65), r);
        return upright;
    case NEGATIVE_ROTATED:
        return random_uniform(r) < 0.6
            ? upright + 90 * DEGREE * (double)(1 + random_below(r, 3))
            : random_range(r, 65, 295) * DEGREE;
    case NEGATIVE_SIZE:
        q->size *= random_uniform(r) < 0.5 ? random_range(r, 0.25, 0.42)
                                           : random_range(r, 2.3, 4);
        return upright;
    case NEGATIVE_SCENERY:
        negative_anywhere(q, f, r);
        return upright + 90 * DEGREE * (double)random_below(r, 4);
    default:
        return fmin(fmax(upright, -25 * DEGREE), 25 * DEGREE);
    }
}

/* out (224,224,3) = the middle of wide (320,320,3) turned by angle. */
static void negative_turn(float *out, const float *wide, double angle)
{
    const double c = cos(angle), s = sin(angle), middle = WIDE / 2.0 - 0.5;

    for (size_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x++, out += 3) {
            double u = (double)x - (N / 2.0 - 0.5);
            double v = (double)y - (N / 2.0 - 0.5);
            double p = middle + c * u - s * v, q = middle + s * u + c * v;
            size_t a = (size_t)p, b = (size_t)q;
            float fx = (float)(p - (double)a), fy = (float)(q - (double)b);
            const float *at = wide + 3 * (b * WIDE + a);

            for (size_t k = 0; k < 3; k++)
                out[k] = fminf((1 - fy) * ((1 - fx) * at[k] + fx * at[3 + k]) +
                               fy * ((1 - fx) * at[3 * WIDE + k] +
                                     fx * at[3 * WIDE + 3 + k]), 1);
        }
}

/* Rows and columns go round, so that the face's parts change places. */
static void negative_shuffle(float *rgb, float *scratch, struct random *r)
{
    size_t dx = N / 4 + random_below(r, (uint32_t)N / 2);
    size_t dy = N / 4 + random_below(r, (uint32_t)N / 2);

    memcpy(scratch, rgb, 3 * N * N * sizeof *rgb);
    for (size_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x++)
            memcpy(rgb + 3 * (y * N + x),
                   scratch + 3 * ((y + dy) % N * N + (x + dx) % N),
                   3 * sizeof *rgb);
}

int negative_sample(float *rgb, const struct data_frame *f, enum negative how,
                    const struct data_augment *augment, struct random *r,
                    struct error *err)
{
    float *wide = malloc(3 * WIDE * WIDE * sizeof *wide);
    struct square q;
    double angle = negative_place(&q, f, how, augment->jitter, r);
    int rc;

    if (!wide)
        return error_set(err, EX_OSERR, "out of memory");
    q.size *= (double)WIDE / (double)N;
    rc = data_sample(wide, WIDE, f, q, augment, r, err);
    if (!rc) {
        negative_turn(rgb, wide, angle);
        if (how == NEGATIVE_PIECES)
            negative_shuffle(rgb, wide, r);
    }
    free(wide);
    return rc;
}
