/* Truths of rendered people agree with their pictures: the background shows
 * nowhere where the mask is full, the person nowhere where it is empty; a
 * picture is the person alone and what the mask leaves of the wall; and what
 * stands in front is labelled wherever it is seen. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/people/scan.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/scan_film.h"
#include "tests/check.h"

enum { S = 96 };

/* ---- a film of scans, its stage made by hand ---------------------------- */

struct agree_print {
    uint8_t rgb[3 * S * S], person[3 * S * S], mask[S * S], label[S * S];
};

/* A disc at (x,y) of radius r in linear light of one colour. */
static void agree_disc(float *light, float *cover, float x, float y, float r,
                       const float rgb[3])
{
    for (size_t i = 0; i < S * S; i++) {
        float d = hypotf((float)(i % S) + 0.5f - x, (float)(i / S) + 0.5f - y);
        float a = fminf(fmaxf(r - d + 0.5f, 0), 1);

        cover[i] = a;
        for (size_t k = 0; k < 3; k++)
            light[3 * i + k] = a * rgb[k];
    }
}

/* One exposure over a wall of one gray; person and front may be left out. */
static void agree_expose(struct agree_print *p, const struct scan_camera *c,
                         float gray, bool person, bool front)
{
    static const float skin[3] = {0.5f, 0.3f, 0.2f}, cup[3] = {0, 0.2f, 0.8f};
    static float light[3 * S * S], alpha[S * S], near[3 * S * S], block[S * S];
    static float wall[3 * S * S];
    static uint8_t tag[S * S];
    const float move[2] = {c->shutter > 0 ? 5 : 0, 0};
    struct figure f = {.exposure = 1};
    struct scan_stage s = {.size = S, .figure = &f, .light = light,
                           .alpha = alpha, .front = near, .block = block,
                           .tag = tag};
    struct scan_print out = {p->rgb, p->person, p->mask, p->label};
    struct scan_film film;
    struct error err = {0};

    f.look.camera = *c;
    f.look.front = front ? FRONT_CUP : FRONT_NONE;
    agree_disc(light, alpha, 45, 50, person ? 28 : -9, skin);
    agree_disc(near, block, 60, 60, front ? 14 : -9, cup);
    for (size_t i = 0; i < S * S && front; i++) {       /* it hides the disc */
        alpha[i] *= 1 - block[i];
        for (size_t k = 0; k < 3; k++)
            light[3 * i + k] *= 1 - block[i];
    }
    for (size_t i = 0; i < 3 * S * S; i++)
        wall[i] = gray;
    REQUIRE(!scan_film_init(&film, S, &err), "%s", err.text);
    scan_expose(&out, &film, &s, wall, 0, 0, move);
    scan_film_release(&film);
}

/* Largest difference of two pictures where mask == at. */
static int agree_largest(const uint8_t *a, const uint8_t *b, const uint8_t *mask,
                      int at)
{
    int largest = 0;

    for (size_t i = 0; i < 3 * S * S; i++)
        if (mask[i / 3] == at && abs(a[i] - b[i]) > largest)
            largest = abs(a[i] - b[i]);
    return largest;
}

static void agree_film(const char *name, struct scan_camera c)
{
    static struct agree_print dark, light, nobody, cup;
    double worst = 0;
    int largest = 0;

    c.contrast = c.saturation = 1;
    printf("-- film: %s\n", name);
    agree_expose(&dark, &c, 0, true, false);
    agree_expose(&light, &c, 0.8f, true, false);
    agree_expose(&nobody, &c, 0.8f, false, false);
    agree_expose(&cup, &c, 0.8f, true, true);
    check("mask full: levels of the wall",
          agree_largest(dark.rgb, light.rgb, light.mask, 255), 1);
    check("mask empty: levels of the person",
          agree_largest(nobody.rgb, light.rgb, light.mask, 0), 1);
    for (size_t i = 0; i < 3 * S * S; i++)
        worst = fmax(worst, fabs(light.person[i]
                                 + (1 - light.mask[i / 3] / 255.0)
                                       * nobody.rgb[i] - light.rgb[i]));
    check("picture = alone + (1 - mask) wall, levels", worst, 1.6);
    for (size_t i = 0; i < 3 * S * S; i++)
        if (cup.label[i / 3] != LABEL_OCCLUDER
            && abs(cup.rgb[i] - light.rgb[i]) > largest)
            largest = abs(cup.rgb[i] - light.rgb[i]);
    check("not labelled as hidden: levels of what is in front", largest, 6);
    check_that("something is", memchr(cup.label, LABEL_OCCLUDER, S * S));
}

int main(void)
{
    noise_lattice_fill();
    agree_film("still", (struct scan_camera){.low = 1});
    agree_film("soft", (struct scan_camera){.blur = 1.6f, .low = 1});
    agree_film("moving", (struct scan_camera){.shutter = 1, .low = 1});
    agree_film("coarse", (struct scan_camera){.low = 0.4f});
    return check_status();
}
