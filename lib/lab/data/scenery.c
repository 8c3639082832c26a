/* Panoramas as a camera would take them: a shot that suits the median light, a
 * darker and a brighter one. */
#include "lib/lab/data/scenery.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/panorama.h"
#include "lib/base/sort.h"

/* What the median becomes, a share of white, before x / (1 + x) brings all of
 * the light in. */
static const float exposure[] = {0.07f, 0.18f, 0.54f};
#define SHOTS (sizeof exposure / sizeof *exposure)

static float scenery_median(const struct panorama *p, float *light)
{
    const size_t n = p->width * p->height;

    for (size_t i = 0; i < n; i++) {
        const float *c = p->rgb + 3 * i;

        light[i] = 0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2];
    }
    sort_floats(light, n);
    return fmaxf(light[n / 2], 1e-6f);
}

/* p at one exposure. */
static void scenery_develop(struct data_frame *f, const struct panorama *p,
                            float gain)
{
    const size_t n = p->width * p->height;

    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < 3; c++) {
            const float x = gain * p->rgb[3 * i + c];

            f->rgba[4 * i + c] =
                (uint8_t)(255 * powf(x / (1 + x), 1 / 2.2f) + 0.5f);
        }
        f->rgba[4 * i + 3] = 255;
    }
}

static int scenery_add(struct scenery *s, const char *path, struct error *err)
{
    struct panorama p;
    float *light, median;

    if (panorama_read(&p, path, err))
        return -1;
    light = malloc(p.width * p.height * sizeof *light);
    median = light ? scenery_median(&p, light) : 0;
    free(light);
    for (size_t k = 0; k < SHOTS && median > 0; k++) {
        struct data_frame *f = s->frame + s->count;

        *f = (struct data_frame){.size = p.width, .width = p.width,
                                 .height = p.height};
        f->rgba = malloc(4 * p.width * p.height);
        if (!f->rgba)
            break;
        scenery_develop(f, &p, exposure[k] / median);
        s->count++;
    }
    panorama_release(&p);
    return s->count % SHOTS || median <= 0
               ? error_set(err, EX_OSERR, "%s: out of memory", path) : 0;
}

int scenery_read(struct scenery *s, const struct names *panoramas,
                 struct error *err)
{
    memset(s, 0, sizeof *s);
    s->frame = calloc(SHOTS * panoramas->count + 1, sizeof *s->frame);
    if (!s->frame)
        return error_set(err, EX_OSERR, "out of memory");
    for (size_t i = 0; i < panoramas->count; i++)
        if (scenery_add(s, panoramas->name[i], err))
            return -1;
    return 0;
}

void scenery_release(struct scenery *s)
{
    for (size_t i = 0; i < s->count; i++)
        free(s->frame[i].rgba);
    free(s->frame);
    memset(s, 0, sizeof *s);
}

const struct data_frame *scenery_draw(const struct scenery *s,
                                      struct random *r)
{
    return s->frame + random_below(r, (uint32_t)s->count);
}
