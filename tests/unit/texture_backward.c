/* Back through the photograph: composition and lookup against differences of
 * the same functions in double, whose values the float ones have, too. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/photo/lookup.h"
#include "tests/check.h"

enum { S = 24, PIXELS = S * S, FIELD = S / TEXTURE_FIELD_STEP,
       PLACES = SPLAT_PLACE_CHANNELS };

static struct random dice;

static float backward_draw(double lo, double hi)
{
    return (float)random_range(&dice, lo, hi);
}

/* Whether a gradient is what differences say. */
static double worst;

static void backward_compare(double got, double want, double scale)
{
    worst = fmax(worst, fabs(got - want) / scale);
}

/* ---- composition -------------------------------------------------------- */

enum { RGB, ALPHA, PHOTO, SAID, KINDS };
static const size_t count[KINDS] = {
    3 * PIXELS, PIXELS, TEXTURE_PHOTO * PIXELS, TEXTURE_FIELD * FIELD * FIELD
};
static float in[KINDS][TEXTURE_PHOTO * PIXELS];
static float grad[KINDS][TEXTURE_PHOTO * PIXELS];
static double wide[KINDS][TEXTURE_PHOTO * PIXELS];
static float probe_rgb[3 * PIXELS], probe_alpha[PIXELS];

/* The field at pixel (x,y), channel c, linear between places. */
static double said_at(size_t x, size_t y, size_t c)
{
    double at[2] = {((double)x + 0.5) / TEXTURE_FIELD_STEP - 0.5,
                    ((double)y + 0.5) / TEXTURE_FIELD_STEP - 0.5};
    double sum = 0;

    for (int k = 0; k < 4; k++) {
        double w = 1;
        size_t i[2];

        for (int d = 0; d < 2; d++) {
            double low = floor(at[d]), t = at[d] - low;
            double place = k >> d & 1 ? low + 1 : low;

            w *= k >> d & 1 ? t : 1 - t;
            i[d] = (size_t)fmin(fmax(place, 0), FIELD - 1);
        }
        sum += w * wide[SAID][TEXTURE_FIELD * (i[1] * FIELD + i[0]) + c];
    }
    return sum;
}

/* Loss: the probes' products with what texture_compose makes, in double. */
static double compose_loss(double *rgb, double *alpha)
{
    double loss = 0;

    for (size_t i = 0; i < PIXELS; i++) {
        const double *p = wide[PHOTO] + TEXTURE_PHOTO * i;
        double doubt = fmin(fmax(said_at(i % S, i / S, 0), 0), 1);
        double was = wide[ALPHA][i], both = fmin(was, p[3]);

        alpha[i] = was + p[4] * (p[3] - was);
        loss += alpha[i] * (double)probe_alpha[i];
        for (size_t c = 0; c < 3; c++) {
            double x = wide[RGB][3 * i + c];
            double photo = p[c] * (1 + said_at(i % S, i / S, c + 1));

            photo += doubt * (x * both / was - photo * both / p[3]);
            x += p[4] * (photo - x);
            rgb[3 * i + c] = fmin(x, alpha[i]);
            loss += rgb[3 * i + c] * (double)probe_rgb[3 * i + c];
        }
    }
    return loss;
}

static void compose_inputs(void)
{
    random_init(&dice, 3, "compose");
    for (size_t i = 0; i < PIXELS; i++) {
        float *p = in[PHOTO] + TEXTURE_PHOTO * i;

        in[ALPHA][i] = backward_draw(0, 1);
        p[3] = backward_draw(0, 1);
        p[4] = random_below(&dice, 4) ? backward_draw(0.05, 0.95) : 0;
        probe_alpha[i] = backward_draw(-1, 1);
        for (size_t c = 0; c < 3; c++) {
            in[RGB][3 * i + c] = backward_draw(0, 1.2) * in[ALPHA][i];
            p[c] = backward_draw(0, 1) * p[3];
            probe_rgb[3 * i + c] = backward_draw(-1, 1);
        }
    }
    for (size_t i = 0; i < count[SAID]; i++)
        in[SAID][i] = backward_draw(-0.6, 0.6);
    for (int k = 0; k < KINDS; k++)
        for (size_t i = 0; i < count[k]; i++)
            wide[k][i] = (double)in[k][i];
}

static void backward_composition(void)
{
    static double rgb[3 * PIXELS], alpha[PIXELS];
    static float got[3 * PIXELS], cover[PIXELS];
    const struct texture_field field = {in[SAID], FIELD, FIELD};
    double off = 0;

    compose_inputs();
    memcpy(got, in[RGB], sizeof got);
    memcpy(cover, in[ALPHA], sizeof cover);
    texture_compose(got, cover, in[PHOTO], &field, S, S);
    compose_loss(rgb, alpha);
    for (size_t i = 0; i < 3 * PIXELS; i++)
        off = fmax(off, fabs((double)got[i] - rgb[i]));
    check("composition", off, 1e-6);
    memcpy(grad[RGB], probe_rgb, sizeof probe_rgb);
    memcpy(grad[ALPHA], probe_alpha, sizeof probe_alpha);
    texture_compose_backward(grad[RGB], grad[ALPHA], grad[PHOTO], grad[SAID],
                             in[RGB], in[ALPHA], in[PHOTO], &field, S, S);
    worst = 0;
    for (int k = 0; k < KINDS; k++)
        for (size_t i = 0; i < count[k]; i++) {
            const double e = 1e-7;
            double keep = wide[k][i], f[2];

            if (k == PHOTO && wide[PHOTO][i / TEXTURE_PHOTO * TEXTURE_PHOTO +
                                          4] == 0)
                continue;           /* nothing is looked up there */
            for (int s = 0; s < 2; s++) {
                wide[k][i] = keep + (s ? e : -e);
                f[s] = compose_loss(rgb, alpha);
            }
            wide[k][i] = keep;
            backward_compare((double)grad[k][i], (f[1] - f[0]) / (2 * e), 1);
        }
    check("its gradient", worst, 1e-5);
}

/* ---- lookup ------------------------------------------------------------- */

static uint8_t rgb8[3 * PIXELS], matte[PIXELS], back[3 * PIXELS];
static const struct splat_place_view view = {
    .A = {0.9f, 0.1f, -0.1f, 0.95f}, .b = {0.02f, -0.03f},
    .shoulders = {0.1f, 0.05f, -0.1f, 0.1f, 0.02f, 0.01f},
    .neck = {0.2f, 1, 0.5f}, .toward = {0.9f, -0.3f}
};
static double place[PLACES * PIXELS], cover[PIXELS];
static float place_f[PLACES * PIXELS], cover_f[PIXELS];
static float dplace[PLACES * PIXELS], dcover[PIXELS], photo[TEXTURE_PHOTO * PIXELS];
static float probe[TEXTURE_PHOTO * PIXELS];

/* Keys's weight of tap k of four. */
static double backward_cubic(int k, double t)
{
    double x = fabs(t + 1 - k);

    return x < 1 ? 1.25 * x * x * x - 2.25 * x * x + 1
         : x < 2 ? -0.75 * x * x * x + 3.75 * x * x - 6 * x + 3 : 0;
}

static double lookup_number(const uint8_t *t, double u, double v, int c)
{
    double fx = floor(u - 0.5), fy = floor(v - 0.5), sum = 0;

    for (int k = 0; k < 16; k++) {
        double x = fmin(fmax(fx - 1 + k % 4, 0), S - 1);
        double y = fmin(fmax(fy - 1 + k / 4, 0), S - 1);

        sum += backward_cubic(k % 4, u - 0.5 - fx)
               * backward_cubic(k / 4, v - 0.5 - fy)
               * t[4 * ((size_t)y * S + (size_t)x) + (size_t)c] / 255.0;
    }
    return fmin(fmax(sum, 0), 1);
}

static double backward_confidence(size_t i)
{
    return fmin(fmax(1.6 * place[PLACES * i + 2] / cover[i] - 0.2, 0), 1) *
           fmin(1.4f / hypot(0.9f, 0.3f) * cover[i], 1);
}

/* Where pixel j's place lies, pixels. */
static void backward_position(double uv[2], size_t j)
{
    const struct splat_place_side side = splat_place_side(&view);
    const double *p = place + PLACES * j;
    const double n[2] = {(2.0 * (double)(j % S) + 1) / S - 1,
                         (2.0 * (double)(j / S) + 1) / S - 1};

    splat_place_at(uv, &view, n[0], n[1]);
    const double along = p[3] * (side.e[0] * uv[0] + side.e[1] * uv[1]);
    for (int k = 0; k < 2; k++)
        uv[k] = 0.5 * S * (uv[k] + (p[k] - along * side.e[k]) / p[2] + 1);
}

/* Confidence where somebody covers pixel i whom the photograph does not show; the view
 * is turned by more than 20 degrees. */
static double backward_covered(double confidence, size_t i, double shown)
{
    const double x = (2.0 * (double)(i % S) + 1) / S - 1;
    const double y = (2.0 * (double)(i / S) + 1) / S - 1;
    const double turned = 1 - fmin(fmax(view.neck[0] * x + view.neck[1] * y +
                                        view.neck[2] - 1, 0), 1);

    return confidence *
           (1 - (1 - shown) * turned * fmax((cover[i] - 0.9) / 0.1, 0));
}

/* What pixel i adds to the loss. */
static double lookup_loss(const struct texture *t, size_t i)
{
    const double confidence = backward_confidence(i);
    const float *by = probe + TEXTURE_PHOTO * i;
    double uv[2], loss;

    backward_position(uv, i);
    loss = by[4] * backward_covered(confidence, i,
                                    lookup_number(t->level[0], uv[0], uv[1], 3));
    for (int c = 0; c < 4 && confidence > 0; c++)
        loss += (double)by[c] * lookup_number(t->level[0], uv[0], uv[1], c);
    return loss;
}

static void lookup_inputs(void)
{
    random_init(&dice, 4, "lookup");
    for (size_t i = 0; i < PIXELS; i++) {
        matte[i] = (uint8_t)(55 + random_below(&dice, 200));
        for (size_t c = 0; c < 3; c++)
            rgb8[3 * i + c] = (uint8_t)random_below(&dice, matte[i] + 1u);
        cover_f[i] = backward_draw(0.3, 1);
        place_f[PLACES * i + 2] = backward_draw(0.4, 1) * cover_f[i];
        for (size_t c = 0; c < 2; c++)
            place_f[PLACES * i + c] = backward_draw(-1.6, 1.6) / S
                                 * place_f[PLACES * i + 2];
        place_f[PLACES * i + 3] = backward_draw(-0.5, 0.7)
                                  * place_f[PLACES * i + 2];
        for (size_t c = 0; c < TEXTURE_PHOTO; c++)
            probe[TEXTURE_PHOTO * i + c] = backward_draw(-1, 1);
    }
    for (size_t i = 0; i < PLACES * PIXELS; i++)
        place[i] = (double)place_f[i];
    for (size_t i = 0; i < PIXELS; i++)
        cover[i] = (double)cover_f[i];
}

/* The derivative by *x, of what pixel i touches. */
static double lookup_difference(const struct texture *t, double *x, size_t i)
{
    const double e = 1e-8, keep = *x;
    double f[2];

    for (int s = 0; s < 2; s++) {
        *x = keep + (s ? e : -e);
        f[s] = lookup_loss(t, i);
    }
    *x = keep;
    return (f[1] - f[0]) / (2 * e);
}

static void backward_lookup(void)
{
    struct texture t;
    struct error err = {0};
    double off = 0;
    size_t doubted = 0;

    lookup_inputs();
    REQUIRE(texture_init(&t, rgb8, matte, back, S, &err) == 0, "%s", err.text);
    texture_lookup(photo, &t, &view, place_f, cover_f, S);
    for (size_t i = 0; i < PIXELS; i++) {
        double confidence = backward_confidence(i), uv[2];

        backward_position(uv, i);
        confidence = backward_covered(
            confidence, i, lookup_number(t.level[0], uv[0], uv[1], 3));
        off = fmax(off, fabs(confidence - (double)photo[TEXTURE_PHOTO * i + 4]));
        doubted += confidence > 0 && confidence < 1;
    }
    check("confidence", off, 1e-5);
    check_that("most pixels are doubted a little", doubted > PIXELS / 3);
    texture_lookup_backward(dplace, dcover, probe, &t, &view, place_f,
                            cover_f, S);
    worst = 0;
    for (size_t i = 0; i < PIXELS; i++) {
        for (size_t c = 0; c < PLACES; c++) {
            double want = lookup_difference(&t, &place[PLACES * i + c], i);

            backward_compare((double)dplace[PLACES * i + c], want, 10 + fabs(want));
        }
        backward_compare((double)dcover[i], lookup_difference(&t, &cover[i], i),
                         1);
    }
    check("its gradient", worst, 1e-3);
    texture_release(&t);
}

int main(void)
{
    backward_composition();
    backward_lookup();
    return check_status();
}
