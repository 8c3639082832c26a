/* Phase A up to beta (Section 3.1): detect, crop, E_m, E_beta; then the
 * matte, from the file, a mask or the picture's colours. */
#include "lib/track/source.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/layers.h"
#include "formats/matte.h"
#include "lib/base/cpu.h"
#include "lib/photo/beyond.h"
#include "lib/photo/network_matte.h"
#include "lib/photo/outline.h"
#include "lib/photo/overlay.h"
#include "lib/track/tta.h"
#include "lib/track/turned.h"

#define SOURCE_SURE 0.8         /* surer than this, other turns are not tried */
#define SOURCE_TURN 0.6         /* and a turn must be surer than this */

const char *source_matte_name(enum source_matte how)
{
    static const char *const name[] = {
        "the file's alpha", "the mask file", "the model's matte network",
        "GrabCut", "a disc about the head (GrabCut found no outline)"
    };

    return name[how];
}

/* How sure E_m is of the face in a (turned) picture; 0 when there is none, -1
 * on an error. */
static double source_encode_turn(struct source *s, struct track *t,
                                 struct track_result *r, const struct image *im,
                                 struct error *err)
{
    int found = track_start(t, r, im->rgb, im->width, im->height, 0, err);

    s->detect_s += r->detect_s;
    return found <= 0 ? found : (double)r->sure;
}

/* 1 when the picture as it is shows a sure face, then *r; else 0, and *quarters
 * is the turn that shows the surest one; -1 on an error. */
static int source_find_turn(struct source *s, struct track *t,
                            struct track_result *r, const struct image *im,
                            int *quarters, struct error *err)
{
    double best = source_encode_turn(s, t, r, im, err);

    *quarters = 0;
    if (best >= SOURCE_SURE)
        return 1;
    for (int k = 1; k < 4 && best >= 0 && best < SOURCE_SURE; k++) {
        struct track_result other;
        struct image turned;
        double sure;

        if (turned_copy(&turned, im, k, err))
            return -1;
        sure = source_encode_turn(s, t, &other, &turned, err);
        image_release(&turned);
        if (sure < 0)
            return -1;
        if (sure > fmax(best, SOURCE_TURN)) {
            best = sure;
            *quarters = k;
        }
    }
    return best < 0 ? -1 : 0;
}

/* Turn the picture and its mask upright.  1: it was, its face is sure, and *r
 * is set; 0; -1 on an error. */
static int source_find_upright(struct source *s, struct track *t,
                               struct track_result *r, struct image *im,
                               struct image *mask, struct error *err)
{
    struct image *const each[2] = {im, mask};
    const int sure = source_find_turn(s, t, r, im, &s->turned, err);

    if (sure)
        return sure;
    for (int i = 0; i < 2 && s->turned; i++) {
        struct image turned;

        if (!each[i])
            continue;
        if (turned_copy(&turned, each[i], s->turned, err))
            return -1;
        image_release(each[i]);
        *each[i] = turned;
    }
    return 0;
}

/* The face and its motion, with the mean head's landmarks for the crop. */
static int source_find_face(struct source *s, struct track *t,
                            struct image *im, struct image *mask,
                            struct error *err)
{
    const bool turns = t->tta.net->sure.ps && !t->opt.has_crop;
    struct track_result r;
    int found = turns ? source_find_upright(s, t, &r, im, mask, err) : 0;

    if (found)          /* the tracker has looked, and follows that face */
        r.detect_s = 0;
    else
        found = track_start(t, &r, im->rgb, im->width, im->height, 0, err);
    if (found < 0)
        return -1;
    if (!found)
        return error_set(err, EX_DATAERR, "no face in a picture of %zu x %zu "
                         "pixels (looked for frontal and profile faces from "
                         "a twelfth of the picture up%s; --crop X,Y,SIZE says "
                         "where it is)", im->width, im->height,
                         t->tta.net->sure.ps ? ", upright and turned" : "");
    s->person.source = r.motion;
    s->person.source.pose.exp = s->person.source.exp;
    s->person.has_source = true;
    s->window = t->window;
    s->person.crop[0] = (float)t->window.x;
    s->person.crop[1] = (float)t->window.y;
    s->person.crop[2] = (float)t->window.size;
    s->crop_s = r.crop_s;
    s->motion_s = r.network_s + r.heads_s;
    s->detect_s += r.detect_s;
    return 0;
}

/* What shape_tta_forward needs to cut a crop of window pixels. */
struct source_view {
    struct track *t;
    const struct image *im;
};

/* The tracker's cut of square q: a tta_crop_fn, ctx is a
 * struct source_view. */
static int source_crop(void *ctx, float *rgb, struct square q,
                       struct error *err)
{
    const struct source_view *v = ctx;

    return track_cut(rgb, v->t, v->im->rgb, v->im->width, v->im->height, q,
                      err);
}

/* beta of the crop the motion encoder last saw. */
static int source_find_shape(struct source *s, struct track *t,
                             const struct image *im, const struct head *head,
                             struct encoders *nets, struct error *err)
{
    double begun = cpu_seconds();
    float beta[SHAPE_ENCODER_OUT];
    const float *c = s->person.source.crop;
    struct source_view v = {t, im};
    struct shape_tta l;
    int rc = -1;

    if (shape_tta_init(&l, &nets->shape, head, err) ||
        shape_tta_forward(beta, &l, (struct square){c[0], c[1], c[2]},
                          source_crop, &v, err))
        goto out;
    s->person.nshape = head->nshape < SHAPE_ENCODER_OUT ? head->nshape
                                                        : SHAPE_ENCODER_OUT;
    s->person.shape = malloc((s->person.nshape + 1) * sizeof *beta);
    if (!s->person.shape) {
        error_set(err, EX_OSERR, "no memory for an identity");
        goto out;
    }
    memcpy(s->person.shape, beta, s->person.nshape * sizeof *beta);
    s->shape_s = cpu_seconds() - begun;
    rc = 0;
out:
    shape_tta_release(&l);
    return rc;
}

/* The portrait window at S x S pixels, and which of them the picture has. */
static int source_cut_window(struct source *s, const struct image *im,
                             size_t S, struct error *err)
{
    double begun = cpu_seconds();
    int rc;

    s->person.size = S;
    s->person.rgb = malloc(3 * S * S);
    s->person.matte = malloc(S * S);
    s->person.back = malloc(3 * S * S);
    free(s->inside);
    s->inside = malloc(S * S);
    if (!s->person.rgb || !s->person.matte || !s->person.back || !s->inside)
        return error_set(err, EX_OSERR, "no memory for the source crop");
    square_inside(s->inside, S, im->width, im->height, s->window);
    rc = crop_resize_u8(s->person.rgb, S, im->rgb, im->width, im->height,
                        3 * im->width, 3, s->window);
    s->crop_s += cpu_seconds() - begun;
    return rc == 0 ? 0 : error_set(err, EX_OSERR, "no memory to resize");
}

/* The matte from a channel of the picture's size. */
static int source_matte_plane(struct source *s, const uint8_t *plane, size_t W,
                              size_t H, size_t step, struct error *err)
{
    uint8_t *one = malloc(W * H);
    int rc = -1;

    if (one) {
        for (size_t i = 0; i < W * H; i++)
            one[i] = plane[i * step];
        rc = crop_resize_u8(s->person.matte, s->person.size, one, W, H, W, 1,
                            s->window);
    }
    free(one);
    return rc == 0 ? 0 : error_set(err, EX_OSERR, "no memory for the matte");
}

/* Whether the matte was found in the picture, not given. */
static bool source_matte_estimated(const struct source *s)
{
    return s->how >= SOURCE_NETWORK;
}

/* Person and background apart, and both beyond the picture's edges.  Only a
 * matte that was guessed is changed at its border. */
static int source_split(struct source *s, struct error *err)
{
    struct person *p = &s->person;
    int rc;

    for (size_t i = 0; i < p->size * p->size; i++)
        if (!s->inside[i])
            p->matte[i] = 0;
    rc = source_matte_estimated(s)
             ? layers_split(p->matte, p->back, p->rgb, s->inside, p->size,
                            err)
             : layers_fill(p->back, p->rgb, p->matte, s->inside, p->size,
                           err);
    if (rc == 0)
        beyond_continue(p, s->inside);
    return rc;
}

/* silhouette [S,S]: 255 where the projected head lands. */
static int source_project_head(uint8_t *silhouette, const struct source *s,
                               const struct head *head, struct error *err)
{
    struct identity id = {0};
    struct overlay o = {0};
    int rc = head_fold(&id, head, s->person.shape, s->person.nshape, err) ||
             overlay_init(&o, &id, err) ? -1 : 0;

    if (rc == 0)
        overlay_silhouette(silhouette, &o, &s->person.source, s->person.size);
    overlay_release(&o);
    identity_release(&id);
    return rc;
}

/* By the matte network: 1, 0 where it sees no person about the head, -1. */
static int source_matte_network(struct source *s, const uint8_t *silhouette,
                                struct encoders *nets, struct error *err)
{
    bool absurd = false;

    s->how = SOURCE_NETWORK;
    return network_matte(s->person.matte, &absurd, s->person.rgb, silhouette,
                         s->inside, s->person.size, &nets->matte, err)
               ? -1 : !absurd;
}

/* From the picture: by the model's network, else by GrabCut, from the
 * projected head's silhouette. */
static int source_matte_found(struct source *s, const struct head *head,
                              struct encoders *nets, struct error *err)
{
    const size_t S = s->person.size;
    uint8_t *silhouette = malloc(S * S);
    bool fallback = false;
    int found = 0, rc = -1;

    if (!silhouette)
        return error_set(err, EX_OSERR, "no memory for the matte");
    if (source_project_head(silhouette, s, head, err))
        goto out;
    if (nets->has_matte && S >= MATTE_SIDE)
        found = source_matte_network(s, silhouette, nets, err);
    rc = found < 0 ? -1 : 0;
    if (!found) {
        rc = matte_grabcut(s->person.matte, &fallback, s->person.rgb,
                           silhouette, s->inside, S, err);
        s->how = fallback ? SOURCE_DISC : SOURCE_GRABCUT;
    }
out:
    free(silhouette);
    return rc;
}

/* The matte that was given, at the size of the window's picture. */
static int source_matte_given(struct source *s, const struct image *im,
                              const struct image *mask, struct error *err)
{
    if (mask && !mask->alpha)
        return source_matte_plane(s, mask->rgb, im->width, im->height, 3, err);
    return source_matte_plane(s, mask ? mask->alpha : im->alpha, im->width,
                              im->height, 1, err);
}

/* The mask's, the file's own, or one found in the picture. */
static int source_make_matte(struct source *s, const struct image *im,
                             const struct image *mask, const struct head *head,
                             struct encoders *nets, struct error *err)
{
    double begun = cpu_seconds();
    int rc;

    if (mask) {
        if (mask->width != im->width || mask->height != im->height)
            return error_set(err, EX_DATAERR, "mask of %zu x %zu pixels "
                             "(expected %zu x %zu, as the picture)",
                             mask->width, mask->height, im->width,
                             im->height);
        s->how = SOURCE_MASK;
        rc = source_matte_given(s, im, mask, err);
    } else if (im->alpha) {
        s->how = SOURCE_ALPHA;
        rc = source_matte_given(s, im, mask, err);
    } else {
        rc = source_matte_found(s, head, nets, err);
    }
    if (rc == 0)
        rc = source_split(s, err);
    s->matte_s = cpu_seconds() - begun;
    return rc;
}

/* The shape once more, by the matte. */
static int source_fit_outline(struct source *s, const struct head *head,
                              struct error *err)
{
    struct outline_report found;
    const double begun = cpu_seconds();
    const int rc = outline_fit(&found, &s->person, head, err);

    s->shape_s += cpu_seconds() - begun;
    return rc;
}

/* The window's picture as fine as it is in the photograph, from what was
 * found at the networks' size (small). */
static int source_refine(struct source *s, const struct person *small,
                         const struct image *im, const struct image *mask,
                         struct error *err)
{
    struct person *p = &s->person;

    if (!source_matte_estimated(s) && source_matte_given(s, im, mask, err))
        return -1;
    return layers_enlarge(p->matte, p->back, p->rgb, p->size, small->matte,
                          small->back, small->rgb, small->size, s->inside,
                          !source_matte_estimated(s), err);
}

/* Where the photograph is finer than what networks see, all of it once more at
 * its own resolution. */
static int source_enlarge(struct source *s, const struct image *im,
                          const struct image *mask, struct error *err)
{
    const double own = fmin(round(s->window.size), PERSON_LARGEST);
    struct person *p = &s->person;
    struct person small = {.rgb = p->rgb, .matte = p->matte, .back = p->back,
                           .size = p->size};
    double begun = cpu_seconds();

    if (!(own > (double)p->size))
        return 0;
    p->rgb = p->matte = p->back = NULL;
    int rc = source_cut_window(s, im, (size_t)own, err) ||
             source_refine(s, &small, im, mask, err) ? -1 : 0;
    person_release(&small);
    s->matte_s += cpu_seconds() - begun;
    return rc;
}

int source_find(struct source *s, struct image *im, struct image *mask,
                const struct head *head, struct encoders *nets,
                const struct track_options *opt, struct error *err)
{
    struct track_options whole = *opt;
    struct identity mean = {0};
    struct track t = {0};

    memset(s, 0, sizeof *s);
    whole.whole = true;
    whole.still = true;
    if (im->width < 16 || im->height < 16)
        return error_set(err, EX_DATAERR, "picture of %zu x %zu pixels "
                         "(expected at least 16 x 16)", im->width,
                         im->height);
    int rc = head_fold(&mean, head, NULL, 0, err) ||
             track_init(&t, &mean, &nets->motion, &whole, err) ||
             source_find_face(s, &t, im, mask, err) ||
             source_find_shape(s, &t, im, head, nets, err) ||
             source_cut_window(s, im, (size_t)opt->size, err) ? -1 : 0;
    track_release(&t);
    identity_release(&mean);
    if (rc)
        source_release(s);
    return rc;
}

int source_cut_out(struct source *s, const struct image *im,
                   const struct image *mask, const struct head *head,
                   struct encoders *nets, struct error *err)
{
    if (source_make_matte(s, im, mask, head, nets, err) == 0 &&
        source_fit_outline(s, head, err) == 0 &&
        source_enlarge(s, im, mask, err) == 0)
        return 0;
    source_release(s);
    return -1;
}

int source_make(struct source *s, struct image *im, struct image *mask,
                const struct head *head, struct encoders *nets,
                const struct track_options *opt, struct error *err)
{
    return source_find(s, im, mask, head, nets, opt, err) ||
           source_cut_out(s, im, mask, head, nets, err) ? -1 : 0;
}

void source_release(struct source *s)
{
    person_release(&s->person);
    free(s->inside);
    memset(s, 0, sizeof *s);
}

struct person source_move_person(struct source *s)
{
    struct person p = s->person;

    memset(&s->person, 0, sizeof s->person);
    return p;
}
