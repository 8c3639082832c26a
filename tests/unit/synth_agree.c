/* Truths of rendered people agree with their pictures: the background shows
 * nowhere where the mask is full, the person nowhere where it is empty; a
 * picture of scans is the person alone and what the mask leaves of the wall;
 * what stands in front is labelled wherever it is seen; and the inside of the
 * mouth is seen between the inner lips alone. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "lib/base/camera.h"
#include "lib/lab/people/lens.h"
#include "lib/lab/people/motion.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/scan_film.h"
#include "lib/lab/people/stage.h"
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
static int agree_most(const uint8_t *a, const uint8_t *b, const uint8_t *mask,
                      int at)
{
    int most = 0;

    for (size_t i = 0; i < 3 * S * S; i++)
        if (mask[i / 3] == at && abs(a[i] - b[i]) > most)
            most = abs(a[i] - b[i]);
    return most;
}

static void agree_film(const char *name, struct scan_camera c)
{
    static struct agree_print dark, light, nobody, cup;
    double worst = 0;
    int most = 0;

    c.contrast = c.saturation = 1;
    printf("-- film: %s\n", name);
    agree_expose(&dark, &c, 0, true, false);
    agree_expose(&light, &c, 0.8f, true, false);
    agree_expose(&nobody, &c, 0.8f, false, false);
    agree_expose(&cup, &c, 0.8f, true, true);
    check("mask full: levels of the wall",
          agree_most(dark.rgb, light.rgb, light.mask, 255), 1);
    check("mask empty: levels of the person",
          agree_most(nobody.rgb, light.rgb, light.mask, 0), 1);
    for (size_t i = 0; i < 3 * S * S; i++)
        worst = fmax(worst, fabs(light.person[i]
                                 + (1 - light.mask[i / 3] / 255.0)
                                       * nobody.rgb[i] - light.rgb[i]));
    check("picture = alone + (1 - mask) wall, levels", worst, 1.6);
    for (size_t i = 0; i < 3 * S * S; i++)
        if (cup.label[i / 3] != LABEL_OCCLUDER
            && abs(cup.rgb[i] - light.rgb[i]) > most)
            most = abs(cup.rgb[i] - light.rgb[i]);
    check("not labelled as hidden: levels of what is in front", most, 6);
    check_that("something is", memchr(cup.label, LABEL_OCCLUDER, S * S));
}

/* ---- people drawn by procedures ----------------------------------------- */

static void agree_head(struct head *h)
{
    struct error err = {0};

    REQUIRE(!head_load(h, "examples/model/head.safetensors", &err), "%s",
            err.text);
}

/* The same frame over a wall of `gray`, or without the person. */
static void agree_drawn_expose(struct stage *s, const struct actor *a,
                               const struct synth_motion *m, float gray,
                               bool person)
{
    static float wall[3 * S * S];
    struct error err = {0};

    for (size_t i = 0; i < 3 * S * S; i++)
        wall[i] = gray;
    REQUIRE(!stage_render(s, a, m, &err), "%s", err.text);
    if (!person) {
        memset(s->light, 0, 3 * S * S * sizeof *s->light);
        memset(s->cover, 0, S * S * sizeof *s->cover);
    }
    lens_expose(s, &a->look, wall, 0, 0, 4, 1);
}

static void agree_drawn(const struct head *h, float blur, float shutter,
                        float low, enum occluder what)
{
    static uint8_t dark[3 * S * S], light[3 * S * S], none[3 * S * S];
    struct persona p;
    struct actor a;
    struct stage s;
    struct synth_motion m;
    struct error err = {0};

    persona_sample(&p, 5, 2, h->nshape, 0);
    p.lens.blur = blur;
    p.lens.shutter = shutter;
    p.lens.low = low;
    p.lens.occluder = what;
    REQUIRE(!actor_init(&a, h, &p, &err) && !stage_init(&s, S, &err), "%s",
            err.text);
    synth_motion(&m, &p, 3, h->nexp, NULL);
    agree_drawn_expose(&s, &a, &m, 0.8f, false);
    memcpy(none, s.rgb, sizeof none);
    agree_drawn_expose(&s, &a, &m, 0, true);
    memcpy(dark, s.rgb, sizeof dark);
    agree_drawn_expose(&s, &a, &m, 0.8f, true);
    memcpy(light, s.rgb, sizeof light);
    printf("-- drawn: blur %g, shutter %g, low %g, occluder %d\n", (double)blur,
           (double)shutter, (double)low, (int)what);
    check("mask full: levels of the wall",
          agree_most(dark, light, s.mask, 255), 3);
    if (what == OCCLUDER_NONE)
        check("mask empty: levels of the person",
              agree_most(none, light, s.mask, 0), 3);
    stage_release(&s);
    actor_release(&a);
}

/* ---- the inside of the mouth -------------------------------------------- */

/* Distance of (x,y) from the polygon uv (n,2), 0 inside. */
static double agree_outside(const double *uv, size_t n, double x, double y)
{
    double best = 1e9;
    bool in = false;

    for (size_t i = 0, j = n - 1; i < n; j = i++) {
        const double *a = uv + 2 * j, *b = uv + 2 * i;
        double e[2] = {b[0] - a[0], b[1] - a[1]};
        double t = ((x - a[0]) * e[0] + (y - a[1]) * e[1])
                   / (e[0] * e[0] + e[1] * e[1] + 1e-12);

        t = fmin(fmax(t, 0), 1);
        best = fmin(best, hypot(a[0] + t * e[0] - x, a[1] + t * e[1] - y));
        if ((a[1] > y) != (b[1] > y)
            && x < a[0] + (y - a[1]) / (b[1] - a[1]) * e[0])
            in = !in;
    }
    return in ? 0 : best;
}

/* Samples of the mouth's inside in all, and how far outside the inner lips'
 * ring the farthest lies, pixels. */
static size_t agree_mouth_frame(double *worst, const struct stage *s,
                                const struct actor *a)
{
    const struct head *h = a->head;
    double uv[2 * 64];
    size_t n = h->nlip_inner, seen = 0;

    REQUIRE(n <= 64, "%zu inner lip vertices (expected 64 at most)", n);
    for (size_t i = 0; i < n; i++) {
        const float *p = s->place + 3 * (size_t)h->lip_inner[i];

        for (size_t k = 0; k < 2; k++)
            uv[2 * i + k] = 0.5 * s->eye.w
                            * (1 + (double)(CAMERA_FOCAL * p[k] / p[2]));
    }
    for (int i = 0; i < s->eye.w * s->eye.w; i++) {
        uint32_t id = s->eye.id[i];

        if (id < h->F || id >= a->nf || (a->label[id] != LABEL_MOUTH
                                         && a->label[id] != LABEL_TEETH))
            continue;
        seen++;
        *worst = fmax(*worst, agree_outside(uv, n, i % s->eye.w + 0.5,
                                            i / s->eye.w + 0.5) / STAGE_GRID);
    }
    return seen;
}

static void agree_mouth(const struct head *h, const char *name)
{
    struct error err = {0};
    struct stage s;
    double worst = 0;
    size_t seen = 0;

    REQUIRE(!stage_init(&s, S, &err), "%s", err.text);
    for (uint64_t who = 0; who < 6; who++) {
        struct persona p;
        struct actor a;

        persona_sample(&p, 21, who, h->nshape, 0);
        p.hair.style = HAIR_SHAVED;
        p.beard_length = 0;
        REQUIRE(!actor_init(&a, h, &p, &err), "%s", err.text);
        for (int k = 0; k < 10; k++) {
            struct synth_motion m;

            synth_motion(&m, &p, 1.7 * k, h->nexp, NULL);
            synth_face_rotation(m.rot, 0.19f * (float)(k - 5), m.pitch, 0);
            m.jaw[0] = 0.06f * (float)(k % 6);
            REQUIRE(!stage_render(&s, &a, &m, &err), "%s", err.text);
            seen += agree_mouth_frame(&worst, &s, &a);
        }
        actor_release(&a);
    }
    printf("-- mouth of %s: %zu samples seen\n", name, seen);
    check_that("mouths are looked into", seen > 2000);
    check("the mouth's inside beyond the inner lips, pixels", worst, 2);
    stage_release(&s);
}

int main(void)
{
    struct head h;

    noise_lattice();
    lens_init();
    agree_film("still", (struct scan_camera){.low = 1});
    agree_film("soft", (struct scan_camera){.blur = 1.6f, .low = 1});
    agree_film("moving", (struct scan_camera){.shutter = 1, .low = 1});
    agree_film("coarse", (struct scan_camera){.low = 0.4f});
    agree_head(&h);
    agree_drawn(&h, 0, 0, 1, OCCLUDER_NONE);
    agree_drawn(&h, 0.9f, 0.03f, 1, OCCLUDER_NONE);
    agree_drawn(&h, 0, 0, 0.4f, OCCLUDER_NONE);
    agree_drawn(&h, 0.9f, 0, 1, OCCLUDER_HAND);
    agree_mouth(&h, "the head of scans");
    head_release(&h);
    return check_status();
}
