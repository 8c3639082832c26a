/* Phase A up to beta (Section 3.1): detect, crop, E_m, E_beta; then the
 * matte, from the file, a mask or the picture's colours. */
#include "lib/track/source.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/photo/matte.h"
#include "lib/photo/outline.h"
#include "lib/photo/overlay.h"
#include "lib/track/tta.h"
#include "lib/track/rotated.h"

const char *source_matte_name(enum source_matte how)
{
    static const char *const name[] = {
        "the file's alpha", "the mask file", "the model's matte network",
        "the head's outline and the colours"
    };

    return name[how];
}

size_t source_finest(size_t drawn)
{
    return 2 * drawn < PERSON_MAX ? 2 * drawn : PERSON_MAX;
}

/* The picture, and its mask, turned by quarters in their place. */
static int source_turn(struct image *im, struct image *mask, int quarters,
                       struct error *err)
{
    struct image *const each[2] = {im, mask};

    for (int i = 0; i < 2 && quarters; i++) {
        struct image rotated;

        if (!each[i])
            continue;
        if (rotated_copy(&rotated, each[i], quarters, err))
            return -1;
        image_release(each[i]);
        *each[i] = rotated;
    }
    return 0;
}

static struct frame source_frame(const struct image *im)
{
    return (struct frame){im->width, im->height, im->rgb, 0, 0, false};
}

/* A face in the picture, which is turned upright: 1, 0, -1. */
static int source_find_upright(struct source *s, struct track *t,
                               struct track_result *r, struct image *im,
                               struct image *mask, struct error *err)
{
    struct frame f = source_frame(im);
    const int found = rotated_start(t, r, &s->notes.rotated, &f, err);

    if (!s->notes.rotated)
        return found;
    if (source_turn(im, mask, s->notes.rotated, err))
        return -1;
    f = source_frame(im);
    return track_start(t, r, &f, NULL, err);
}

/* How many of the face's landmarks lie beyond the picture's edges. */
static size_t source_count_outside(struct track *t, const struct motion *m,
                                   const struct image *im)
{
    const float S = (float)t->opt.size;
    const struct extent seen = square_extent((size_t)S, im->width, im->height,
                                             t->window);
    float uv[2 * HEAD_LANDMARKS];
    size_t n = HEAD_LANDMARKS;

    track_project(uv, t, m);
    for (const float *p = uv; p < uv + 2 * HEAD_LANDMARKS; p += 2)
        n -= p[0] >= 0 && p[0] < S && p[1] >= 0 && p[1] < S &&
             extent_has(&seen, (size_t)p[0], (size_t)p[1]);
    return n;
}

/* The face and its motion, with the mean head's landmarks for the crop. */
static int source_find_face(struct source *s, struct track *t,
                            struct image *im, struct image *mask,
                            struct error *err)
{
    struct track_result r;
    const int found = source_find_upright(s, t, &r, im, mask, err);

    if (found < 0)
        return -1;
    if (!found && t->opt.face > 1)
        return error_set(err, EX_DATAERR, "%zu face%s in a picture of %zu x "
                         "%zu pixels (expected %ld for --face)", t->max_faces,
                         plural(t->max_faces), im->width, im->height,
                         t->opt.face);
    if (!found)
        return error_set(err, EX_DATAERR, "no face in a %spicture of %zu x "
                         "%zu pixels (looked for faces from a 24th of the "
                         "picture up%s; --crop X,Y,SIZE says where it is)",
                         im->damaged ? "damaged or cut short " : "",
                         im->width, im->height,
                         t->tta.net->confidence.ps ? ", upright and turned" : "");
    s->person.source = r.motion;
    s->person.source.pose.exp = s->person.source.exp;
    s->person.calm = s->person.source;
    calm_face(&s->person.calm, &t->calm);
    s->person.has_source = true;
    s->confidence = r.confidence;
    s->notes.outside = source_count_outside(t, &r.motion, im);
    s->window = t->window;
    s->notes.faces = t->faces;
    s->person.crop[0] = (float)t->window.x;
    s->person.crop[1] = (float)t->window.y;
    s->person.crop[2] = (float)t->window.size;
    s->crop_s = r.crop_s;
    s->motion_s = r.network_s + r.heads_s;
    s->detect_s += r.detect_s;
    return 0;
}

/* beta and light of the crop the motion encoder last saw. */
static int source_find_shape(struct source *s, struct track *t,
                             const struct head *head, struct encoders *nets,
                             struct error *err)
{
    double begun = cpu_seconds();
    float beta[SHAPE_ENCODER_OUT];
    const float *c = s->person.source.crop;
    struct shape_tta l;
    int rc = -1;

    if (shape_tta_init(&l, &nets->shape, head, err) ||
        shape_tta_forward(beta, &l, (struct square){c[0], c[1], c[2]},
                          track_crop, t, err) ||
        light_of_crop(&s->person.source, &nets->light,
                      (struct square){c[0], c[1], c[2]}, track_crop, t, err))
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

/* The portrait window as fine as it is in the photograph and is wanted, but not
 * coarser than the networks see it, and which of its pixels the picture has. */
static int source_cut_window(struct source *s, const struct image *im,
                             struct error *err)
{
    const double own = fmin(round(s->window.size), (double)s->finest);
    const size_t S = own > (double)s->size ? (size_t)own : s->size;
    double begun = cpu_seconds();
    int rc;

    s->person.size = S;
    s->person.rgb = malloc(3 * S * S);
    s->person.matte = malloc(S * S);
    s->person.back = malloc(3 * S * S);
    s->person.confidence = malloc(S * S);
    if (!s->person.rgb || !s->person.matte || !s->person.back ||
        !s->person.confidence)
        return error_set(err, EX_OSERR, "no memory for the source crop");
    s->inside = square_extent(S, im->width, im->height, s->window);
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

/* The person's picture, as matting has it. */
static struct matting source_matting(const struct source *s)
{
    const struct person *p = &s->person;

    return (struct matting){p->size, s->inside, p->rgb, p->matte,
                            p->confidence, p->back};
}

/* silhouette (n,n): 255 where the projected head lands. */
static int source_project_head(uint8_t *silhouette, size_t n,
                               const struct source *s,
                               const struct head *head, struct error *err)
{
    struct identity id = {0};
    struct overlay o = {0};
    int rc = head_fold(&id, head, s->person.shape, s->person.nshape, err) ||
             overlay_init(&o, &id, err) ? -1 : 0;

    if (rc == 0)
        overlay_silhouette(silhouette, &o, &s->person.source, n);
    overlay_release(&o);
    identity_release(&id);
    return rc;
}

/* Whether a matte that was given shows somebody where the head (n,n) lands: of a
 * London photograph the person is 0.94 of it, brows to chin 0.44, and all but the
 * person, as of a mask the wrong way round, 0.06. */
static int source_check_matte(const struct source *s, const uint8_t *silhouette,
                              size_t n, struct error *err)
{
    const size_t S = s->person.size;
    double head = 0, shown = 0;

    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n; x++) {
            const double w = silhouette[y * n + x];

            head += w;
            shown += w / 255 * s->person.matte[y * S / n * S + x * S / n];
        }
    return shown >= head / 4 ? 0
         : error_set(err, EX_DATAERR, "%s shows nobody where the face is "
                     "(expected white where the person is)",
                     source_matte_name(s->notes.how));
}

/* By the model's network or by the projected head; known: beyond the picture's
 * edges only. */
static int source_find_matte(struct source *s, const struct head *head,
                             struct encoders *nets, bool known,
                             struct error *err)
{
    static const size_t side = MATTE_SIDE;
    uint8_t *silhouette = malloc(side * side);
    struct matting m = source_matting(s);
    bool seen = false;
    int rc = -1;

    if (!silhouette)
        return error_set(err, EX_OSERR, "no memory for the matte");
    if (source_project_head(silhouette, side, s, head, err) == 0 &&
        (!known || source_check_matte(s, silhouette, side, err) == 0))
        rc = matte_find(&m, &seen, silhouette,
                        nets->has_matte ? &nets->matte : NULL, known, err);
    if (!known)
        s->notes.how = seen ? SOURCE_NETWORK : SOURCE_HEAD;
    free(silhouette);
    return rc;
}

/* The matte that was given, at the size of the window's picture. */
static int source_matte_given(struct source *s, const struct image *im,
                              const struct image *mask, struct error *err)
{
    const bool grey = mask && !mask->alpha;
    const uint8_t *plane = grey ? mask->rgb : mask ? mask->alpha : im->alpha;

    s->notes.how = mask ? SOURCE_MASK : SOURCE_ALPHA;
    return source_matte_plane(s, plane, im->width, im->height, grey ? 3 : 1,
                              err);
}

/* The mask's, the file's own, or one found in the picture. */
static int source_make_matte(struct source *s, const struct image *im,
                             const struct image *mask, const struct head *head,
                             struct encoders *nets, struct error *err)
{
    const double begun = cpu_seconds();
    const bool given = mask || im->alpha;

    if (mask && (mask->width != im->width || mask->height != im->height))
        return error_set(err, EX_DATAERR, "mask of %zu x %zu pixels "
                         "(expected %zu x %zu, as the picture)", mask->width,
                         mask->height, im->width, im->height);
    const int rc = (given && source_matte_given(s, im, mask, err)) ||
                   source_find_matte(s, head, nets, given, err) ? -1 : 0;

    s->matte_s += cpu_seconds() - begun;
    return rc;
}

/* The shape once more, by the matte at the networks' size. */
static int source_fit_outline(struct source *s, const struct head *head,
                              struct error *err)
{
    struct person *p = &s->person, small, seen = *p;
    struct outline_report found;
    const double begun = cpu_seconds();

    seen.back = seen.confidence = NULL;
    if (person_resize(&small, &seen, s->size, err))
        return -1;
    small.source = p->source;
    small.has_source = p->has_source;
    small.shape = p->shape;
    small.nshape = p->nshape;
    const int rc = outline_fit(&found, &small, head, err);

    small.shape = NULL;
    person_release(&small);
    s->shape_s += cpu_seconds() - begun;
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
    s->notes.damaged = im->damaged;
    s->size = (size_t)opt->size;
    s->finest = opt->finest ? opt->finest : PERSON_MAX;
    whole.whole = true;
    whole.still = true;
    if (im->width < 16 || im->height < 16)
        return error_set(err, EX_DATAERR, "picture of %zu x %zu pixels "
                         "(expected at least 16 x 16)", im->width,
                         im->height);
    int rc = head_fold(&mean, head, NULL, 0, err) ||
             track_init(&t, &mean, &nets->motion, &whole, err) ||
             source_find_face(s, &t, im, mask, err) ||
             source_find_shape(s, &t, head, nets, err) ||
             source_cut_window(s, im, err) ? -1 : 0;
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
        source_fit_outline(s, head, err) == 0)
        return 0;
    source_release(s);
    return -1;
}

int source_make(struct source *s, struct image *im, const struct head *head,
                struct encoders *nets, const struct track_options *opt,
                struct error *err)
{
    return source_find(s, im, NULL, head, nets, opt, err) ||
           source_cut_out(s, im, NULL, head, nets, err) ? -1 : 0;
}

void source_release(struct source *s)
{
    person_release(&s->person);
    memset(s, 0, sizeof *s);
}

struct person source_move_person(struct source *s)
{
    struct person p = s->person;

    memset(&s->person, 0, sizeof s->person);
    return p;
}
