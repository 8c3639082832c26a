/* Sizes, backgrounds and frames of a clip's pictures (framing.h). */
#include "lib/animate/framing.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/photo/backdrop.h"
#include "lib/track/source.h"

/* SpiD* draws pictures as large as they are; the refiner works at the model's
 * size at most, and what it gives is enlarged. */
static void framing_choose_size(struct pipeline_options *opt,
                                const struct framing_options *want,
                                const struct prepared *s)
{
    const size_t model = want->model_size;

    opt->picture = want->size ? (size_t)want->size : model;
    if (want->into_source && !want->size && s->person.size > model)
        opt->picture = s->person.size;
    opt->size = opt->picture;
    if (!opt->star && opt->size > model)
        opt->size = model;
}

size_t framing_finest(const struct framing_options *want)
{
    if (want->into_source && !want->size)
        return PERSON_MAX;
    return source_finest(want->size ? (size_t)want->size : want->model_size);
}

/* Pixels of n that lie between 0 and end, of a window that starts at `start`
 * and is `side` long. */
static void framing_cut_axis(size_t *from, size_t *count, double start,
                             double side, double end, size_t n)
{
    const double k = (double)n / side;
    const double lo = ceil(fmax(-start, 0) * k - 1e-6);
    const double hi = floor(fmin(end - start, side) * k + 1e-6);

    *from = (size_t)lo;
    *count = hi > lo ? (size_t)(hi - lo) : 0;
}

/* The part of the portrait that the photograph reaches. */
static int framing_cut(struct framing *f, const struct prepared *s, size_t n,
                       struct error *err)
{
    const double side = (double)s->person.crop[2];
    const double x = (double)s->person.crop[0] - side / 2;
    const double y = (double)s->person.crop[1] - side / 2;

    framing_cut_axis(&f->part.left, &f->part.width, x, side,
                     (double)s->picture.width, n);
    framing_cut_axis(&f->part.top, &f->part.height, y, side,
                     (double)s->picture.height, n);
    if (f->part.width && f->part.height)
        return 0;
    return error_set(err, EX_DATAERR, "the portrait window lies outside of "
                     "the picture");
}

/* The photograph's background behind what is written. */
static int framing_background(struct framing *f,
                              const struct framing_options *want,
                              const struct prepared *s, size_t n,
                              struct error *err)
{
    const struct person *p = &s->person;
    struct background own = {0};

    if (!p->rgb)
        return error_set(err, EX_DATAERR, "no picture for the background");
    if (backdrop_of_person(&own, p, err))
        return -1;
    int rc = background_fit(&f->background, &own, n, err);
    background_release(&own);
    if (rc || !want->cut)
        return rc;
    uint8_t *rgb = f->background.rgb;
    for (size_t y = 0; y < f->part.height; y++)
        memmove(rgb + 3 * y * f->part.width,
                rgb + 3 * ((y + f->part.top) * n + f->part.left),
                3 * f->part.width);
    f->background.width = f->part.width;
    f->background.height = f->part.height;
    return 0;
}

int framing_init(struct framing *f, struct animate_options *opt,
                 const struct framing_options *want,
                 const struct prepared *s, struct error *err)
{
    memset(f, 0, sizeof *f);
    if ((want->into_source || want->cut) && !s->picture.rgb)
        return error_set(err, EX_DATAERR, "an identity holds no whole "
                         "photograph (expected a picture as SOURCE with "
                         "--%s)", want->cut ? "cut" : "into-source");
    framing_choose_size(&opt->pipeline, want, s);
    opt->inset = NULL;
    opt->part = NULL;
    const size_t picture = opt->pipeline.picture;
    if (want->into_source) {
        if (inset_init(&f->inset, &s->picture, &s->person, picture, err))
            return -1;
        opt->inset = &f->inset;
        return 0;
    }
    if (want->cut && framing_cut(f, s, picture, err))
        return -1;
    if (want->cut)
        opt->part = &f->part;
    if ((want->source_background ||
         (!want->background_given && s->picture.rgb)) &&
        framing_background(f, want, s, picture, err))
        return -1;
    return 0;
}

void framing_release(struct framing *f)
{
    inset_release(&f->inset);
    background_release(&f->background);
    memset(f, 0, sizeof *f);
}
