/* L_img, L_perc and L_lmk (Section 3.3) through avatar, renderer and refiner:
 * what a picture costs, and the gradient back to the Gaussians and the
 * motion. */
#include "lib/lab/train/avatar_system.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/slices.h"
#include "lib/base/camera.h"
#include "lib/nn/image.h"
#include "lib/splat/relight.h"
#include "lib/splat/splat.h"
#include "lib/photo/place.h"
#include "lib/lab/train/losses.h"

const char *const picture_term_name[PICTURE_COUNT] = {
    "coarse", "coarse_face", "final", "final_face", "perceptual", "mask",
    "square", "mouth", "alignment"};

int avatar_system_init(struct avatar_system *s, struct params *ps,
                       const struct avatar_config *config,
                       const struct head *h, struct error *err)
{
    memset(s, 0, sizeof *s);
    s->config = *config;
    s->head = h;
    s->channels = config->has_refiner ? config->channels : 3;
    s->photo = config->has_refiner && config->refiner.photo;
    if (avatar_init(&s->avatar, ps, config, h, err))
        return -1;
    return config->has_refiner
               ? refiner_init(&s->refiner, ps, "refine.", &config->refiner,
                              err)
               : 0;
}

/* Memory for pictures of s->image pixels and the source. */
static int avatar_system_allocate(struct avatar_system *s, struct error *err)
{
    size_t n = s->image * s->image, C = s->channels, V = s->head->V;
    size_t N = s->avatar.dynamic.count + s->avatar.plane.count +
               s->avatar.mouth.count;
    size_t P = TEXTURE_PHOTO, step = TEXTURE_FIELD_STEP;
    size_t side = relight_side(s->image);
    const struct slice slices[] = {
        {&s->feat, n * C, false}, {&s->dfeat, n * C, false},
        {&s->alpha, n, false}, {&s->dalpha, n, false},
        {&s->rgb, 3 * n, false}, {&s->drgb, 3 * n, false},
        {&s->rgb_alpha, n, false}, {&s->drgb_alpha, n, false},
        {&s->refined, 3 * n, false},
        {&s->coarse, 3 * n, false}, {&s->dcoarse, 3 * n, false},
        {&s->coarse_alpha, n, false},
        {&s->place, s->photo ? SPLAT_PLACE_CHANNELS * n : 1, false},
        {&s->dplace, s->photo ? SPLAT_PLACE_CHANNELS * n : 1, false},
        {&s->shown, P * n, false}, {&s->dshown, 2 * P * n, false},
        {&s->gain, side * side, false},
        {&s->dfield, n / (step * step) * TEXTURE_FIELD, false},
        {&s->target, 3 * n, false}, {&s->mask, n, false},
        {&s->means, 3 * N, false}, {&s->verts, 3 * V, false},
        {&s->dverts, 3 * V, false}, {&s->source, 3 * V, false},
        {&s->rest, 3 * V, false},
        {&s->tmp, loss_pyramid_scratch(s->image, s->image), false},
    };

    if (slices_allocate(&s->block, slices, sizeof slices / sizeof *slices,
                        true, err))
        return -1;
    memset(s->shown, 0, P * n * sizeof *s->shown);
    return 0;
}

/* Exact exponentials of low degree; smooth takes the cut-offs away, so that
 * differences can be taken. */
int avatar_system_plan(struct avatar_system *s, size_t image, bool fresh,
                       bool smooth, struct nn_options opt, struct error *err)
{
    struct splat_options so = splat_defaults((int)image, (int)image,
                                             (int)s->channels);

    const struct nn_options use = {NN_INFER, opt.type};
    const struct nn_options avatar = s->fixed ? use : opt;

    s->image = image;
    so.gradients = avatar.mode != NN_INFER;
    so.place = s->photo;
    so.exp_degree = 5;
    if (smooth) {
        so.alpha_cut = 1.0f / (1 << 24);
        so.t_cut = 0;
    }
    if (fresh)
        avatar_init_weights(&s->avatar);
    if (avatar_system_allocate(s, err) ||
        avatar_plan(&s->avatar, avatar, err) ||
        (s->config.has_refiner &&
         refiner_plan(&s->refiner, 1, image, image, opt, err)))
        return -1;
    return splat_init(&s->splat, &so, err);
}

int avatar_system_perceptual(struct avatar_system *s, const char *path,
                             struct error *err)
{
    /* a face fills about half of the picture */
    size_t side = s->image / 2 < 64 ? 64 : s->image / 2;

    return perceptual_open(&s->perceptual, path, side, err);
}

int avatar_system_alignment(struct avatar_system *s, const char *path,
                            struct error *err)
{
    /* a small picture shows no more than it has */
    size_t side = s->image / FAN_MULTIPLE * FAN_MULTIPLE;

    side = side < FAN_MULTIPLE ? FAN_MULTIPLE : side;
    return alignment_open(&s->alignment, path,
                          side < FAN_SIDE ? side : FAN_SIDE, err);
}

void avatar_system_release(struct avatar_system *s)
{
    splat_release(&s->splat);
    if (s->config.has_refiner)
        refiner_release(&s->refiner);
    avatar_release(&s->avatar);
    if (s->perceptual.side)
        perceptual_release(&s->perceptual);
    if (s->alignment.side)
        alignment_release(&s->alignment);
    texture_release(&s->texture);
    free(s->block);
    memset(s, 0, sizeof *s);
}

/* Phase A on a source photograph, and the texture of all frames to come. */
static int avatar_system_read(struct avatar_system *s, const struct person *p,
                              const float *cam, const float *light,
                              struct error *err)
{
    const size_t n = p->size * p->size;
    uint8_t *own = malloc(3 * n);

    if (!own)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    texture_straight(own, p->rgb, p->matte, p->back, n);
    avatar_bake(&s->avatar, &(struct avatar_source){
        .rgb = own, .matte = p->matte, .verts = s->source, .cam = cam,
        .light = light, .rest = s->rest
    });
    free(own);
    texture_release(&s->texture);
    return s->photo ? texture_init(&s->texture, p->rgb, p->matte, p->back,
                                   p->size, err) : 0;
}

/* Phase A of a training frame: its own picture is the source. */
int avatar_system_bake(struct avatar_system *s, const struct data_frame *f,
                       const struct identity *id, const struct head_motion *m,
                       const float *cam, struct error *err)
{
    struct person person = {0};
    struct head_motion truth;
    float truth_cam[12];
    int rc;

    if (data_source(&person, f, s->config.size, err))
        return -1;
    data_truth(&truth, truth_cam, f);
    memcpy(s->source_cam, m ? cam : truth_cam, sizeof s->source_cam);
    head_pose(s->source, id, m ? m : &truth);
    identity_rest(s->rest, id);
    rc = avatar_system_read(s, &person, s->source_cam,
                            f->motion.lit ? f->motion.light : NULL, err);
    person_release(&person);
    return rc ? -1 : splat_load(&s->splat, &s->avatar.set, err);
}

/* What is said of the photograph; said: by the refiner, else nothing. */
static struct texture_field avatar_system_field(const struct avatar_system *s,
                                                bool said)
{
    return (struct texture_field){said ? refiner_field(&s->refiner) : NULL,
                                  s->image / TEXTURE_FIELD_STEP,
                                  s->image / TEXTURE_FIELD_STEP};
}

/* The light's change from the source to cam. */
static void avatar_system_find_gain(struct avatar_system *s,
                                    const float cam[12])
{
    const float *l = s->avatar.light;
    float now[LAMP_SIZE], tint[3];

    s->lit = l[0] != 0 || l[1] != 0 || l[2] != 0;
    if (!s->lit)
        return;
    relative_light(now, s->avatar.lamp, cam);
    splat_relight(s->gain, tint, &s->splat, now);
}

/* A picture (image,image,3) whose coverage is alpha in it, in place. */
static void avatar_system_relight(const struct avatar_system *s, float *rgb,
                                  const float *alpha)
{
    if (s->lit)
        relight_apply(rgb, 3, alpha, s->gain, NULL, s->image, s->image,
                      s->image);
}

/* Eq. C, and the photograph in what was drawn: SpiD*. */
static int avatar_system_splat(struct avatar_system *s, const float cam[12],
                               struct error *err)
{
    size_t n = s->image * s->image, C = s->channels;
    struct splat_camera sc = splat_camera_square(cam, (int)s->image,
                                                 CAMERA_FOCAL);
    struct splat_pictures out = {.image = s->feat, .alpha = s->alpha,
                                 .place = s->photo ? s->place : NULL};
    const struct texture_field none = avatar_system_field(s, false);

    if (s->photo)
        place_view_make(&s->view, s->source_cam, cam, NULL);
    if (splat_draw(&s->splat, &out, &sc, &s->view, NULL, err))
        return -1;
    for (size_t i = 0; i < n; i++)
        memcpy(s->coarse + 3 * i, s->feat + C * i, 3 * sizeof *s->coarse);
    memcpy(s->coarse_alpha, s->alpha, n * sizeof *s->alpha);
    if (!s->photo)
        return 0;
    texture_lookup(s->shown, &s->texture, &s->view, s->place, s->alpha,
                   s->image);
    texture_compose(s->coarse, s->coarse_alpha, s->shown, &none, s->image,
                    s->image);
    avatar_system_find_gain(s, cam);
    avatar_system_relight(s, s->coarse, s->coarse_alpha);
    return 0;
}

/* Phase B: drive, render, refine. */
int avatar_system_draw(struct avatar_system *s, const float *verts,
                       const float cam[12], struct error *err)
{
    struct avatar *a = &s->avatar;
    size_t n = s->image * s->image;
    float turn[RELATIVE_POSE_SIZE];

    avatar_drive(s->means, a, verts, cam);
    if (splat_update(&s->splat, s->means, 0, a->set.n, err) ||
        avatar_system_splat(s, cam, err))
        return -1;
    if (!s->config.has_refiner) {
        memcpy(s->rgb, s->coarse, 3 * n * sizeof *s->rgb);
        memcpy(s->rgb_alpha, s->coarse_alpha, n * sizeof *s->rgb_alpha);
        return 0;
    }
    avatar_relative_pose(turn, a, cam);
    refiner_turn(&s->refiner, turn);
    refiner_photo(&s->refiner, s->shown);
    refiner_forward(s->refined, s->feat, &s->refiner);
    const struct texture_field field = avatar_system_field(s, true);
    memcpy(s->rgb, s->refined, 3 * n * sizeof *s->rgb);
    memcpy(s->rgb_alpha, s->alpha, n * sizeof *s->rgb_alpha);
    texture_compose(s->rgb, s->rgb_alpha, s->shown, &field, s->image,
                    s->image);
    avatar_system_relight(s, s->rgb, s->rgb_alpha);
    return 0;
}

/* Mean square instead, of the whole picture: see train_config.smooth. */
static void avatar_system_smooth_losses(struct avatar_system *s, double *terms,
                                        const struct train_config *c,
                                        double scale)
{
    size_t n = s->image * s->image;

    terms[PICTURE_COARSE] += loss_l2(s->dcoarse, s->coarse, s->target, 3 * n,
                                     c->coarse * scale);
    terms[PICTURE_FINAL] += loss_l2(s->drgb, s->rgb, s->target, 3 * n,
                                    c->refined * scale);
    terms[PICTURE_MASK] += loss_l2(s->drgb_alpha, s->rgb_alpha, s->mask, n,
                                   c->silhouette * scale);
}

/* Teeth and tongue are some hundred pixels of many thousands, and what is the
 * median of a colour is grey: the open mouth as a picture of its own. */
static void avatar_system_mouth_loss(struct avatar_system *s, double *terms,
                                     float *d, const float *y,
                                     const struct data_frame *f,
                                     const struct train_config *c,
                                     double scale)
{
    size_t S = s->image;
    struct box box = data_mouth(f, S);

    if (c->mouth == 0 || box_is_empty(box))
        return;
    terms[PICTURE_MOUTH] += loss_l1(d, y, s->target, S, S, &box,
                                    c->mouth * scale);
    terms[PICTURE_MOUTH] += loss_pyramid(d, y, s->target, S, S, &box,
                                         0.5 * c->mouth * scale, s->tmp);
}

/* L_perc of picture y inside the box, its gradient to d. */
static double avatar_system_perceptual_loss(struct avatar_system *s, float *d,
                                            const float *y,
                                            const struct box *box,
                                            double weight)
{
    size_t S = s->image;

    if (!s->perceptual.side)
        return loss_pyramid(d, y, s->target, S, S, box, weight, s->tmp);
    return weight > 0 ? perceptual_loss(d, y, S, S, box, weight,
                                        &s->perceptual)
                      : 0;
}

/* L_lmk of picture y, its gradient to d. */
static double avatar_system_alignment_loss(struct avatar_system *s, float *d,
                                           const float *y,
                                           const struct data_frame *f,
                                           double weight)
{
    size_t S = s->image;
    double k = (double)S / (double)f->size;
    struct square q = {f->crop.x * k, f->crop.y * k,
                       f->crop.size * k * ALIGNMENT_GROW};

    if (!s->alignment.side || weight == 0)
        return 0;
    alignment_target(&s->alignment, s->target, S, S, q);
    return alignment_loss(d, y, S, S, q, weight, &s->alignment);
}

/* L_img and L_perc of one picture y, the final or the coarse one; what hides
 * the person costs nothing. */
static void avatar_system_picture_losses(struct avatar_system *s,
                                         double *terms, bool final,
                                         const struct data_frame *f,
                                         const struct train_config *c,
                                         double scale)
{
    size_t S = s->image;
    struct box face = data_face(f, S);
    float *d = final ? s->drgb : s->dcoarse;
    const float *y = final ? s->rgb : s->coarse;
    double weight = final ? c->refined : c->coarse;

    data_mask_occluded(s->target, y, 3, S, f);
    terms[final ? PICTURE_FINAL : PICTURE_COARSE] +=
        loss_l1(d, y, s->target, S, S, NULL, weight * scale);
    terms[final ? PICTURE_FINAL_FACE : PICTURE_COARSE_FACE] +=
        loss_l1(d, y, s->target, S, S, &face, weight * c->face * scale);
    if (s->perceptual.side && c->perceptual > 0)
        perceptual_target(&s->perceptual, s->target, S, S, &face);
    terms[PICTURE_PERCEPTUAL] += avatar_system_perceptual_loss(
        s, d, y, &face, c->perceptual * scale);
    terms[PICTURE_SQUARE] += loss_l2(d, y, s->target, 3 * S * S,
                                     c->square * scale);
    avatar_system_mouth_loss(s, terms, d, y, f, c, scale);
    if (final == s->config.has_refiner)
        terms[PICTURE_ALIGNMENT] += avatar_system_alignment_loss(
            s, d, y, f, c->alignment * scale);
}

/* Of both pictures, and the silhouette of the final one. */
int avatar_system_losses(struct avatar_system *s, double *terms,
                         const struct data_frame *f,
                         const struct train_config *c, double scale,
                         struct error *err)
{
    size_t S = s->image, n = S * S;

    if (data_portrait(s->target, s->mask, S, f, err))
        return -1;
    memset(s->dcoarse, 0, 3 * n * sizeof *s->dcoarse);
    memset(s->drgb, 0, 3 * n * sizeof *s->drgb);
    memset(s->drgb_alpha, 0, n * sizeof *s->drgb_alpha);
    if (c->smooth) {
        avatar_system_smooth_losses(s, terms, c, scale);
        return 0;
    }
    data_mask_occluded(s->mask, s->rgb_alpha, 1, S, f);
    terms[PICTURE_MASK] += loss_l2(s->drgb_alpha, s->rgb_alpha, s->mask, n,
                                   c->silhouette * scale);
    if (!s->fixed)
        avatar_system_picture_losses(s, terms, false, f, c, scale);
    if (s->config.has_refiner)
        avatar_system_picture_losses(s, terms, true, f, c, scale);
    return 0;
}

/* Back through texture_compose for one picture: the gradient of what went in
 * replaces d's, s->dalpha and the first half of s->dshown are added to. */
static void avatar_system_compose_backward(struct avatar_system *s, float *d,
                                           float *dalpha, const float *in,
                                           bool said)
{
    size_t n = s->image * s->image;
    float *more = s->dshown + TEXTURE_PHOTO * n;
    const struct texture_field field = avatar_system_field(s, said);

    texture_compose_backward(d, dalpha, more, s->dfield, in, s->alpha,
                             s->shown, &field, s->image, s->image);
    for (size_t i = 0; i < TEXTURE_PHOTO * n; i++)
        s->dshown[i] += more[i];
    for (size_t i = 0; i < n; i++)
        s->dalpha[i] += dalpha[i];
}

/* The final picture's share: back through composition and refiner. */
static void avatar_system_refined_backward(struct avatar_system *s,
                                           float dturn[RELATIVE_POSE_SIZE])
{
    size_t n = s->image * s->image;
    float *more = s->dshown + TEXTURE_PHOTO * n;
    const struct refiner_gradients g = {
        .feat = s->fixed ? NULL : s->dfeat, .turn = dturn,
        .photo = s->fixed || !s->photo ? NULL : more
    };

    if (s->lit)
        relight_apply_backward(s->drgb, s->drgb_alpha, s->rgb, 3, s->rgb_alpha,
                               s->gain, s->image);
    avatar_system_compose_backward(s, s->drgb, s->drgb_alpha, s->refined,
                                   true);
    refiner_backward(&g, s->drgb, s->dfield, &s->refiner);
    for (size_t i = 0; g.photo && i < TEXTURE_PHOTO * n; i++)
        s->dshown[i] += more[i];
}

/* The coarse picture's share, into s->dfeat's first three channels. */
static void avatar_system_coarse_backward(struct avatar_system *s)
{
    size_t n = s->image * s->image, C = s->channels;

    if (!s->config.has_refiner)     /* it is the final picture, too */
        image_add(s->dcoarse, s->drgb, 3 * n);
    if (s->photo) {
        for (size_t i = 0; i < n; i++)      /* in: as splatted */
            memcpy(s->refined + 3 * i, s->feat + C * i,
                   3 * sizeof *s->refined);
        memset(s->drgb_alpha, 0, n * sizeof *s->drgb_alpha);
        if (s->lit)
            relight_apply_backward(s->dcoarse, s->drgb_alpha, s->coarse, 3,
                                   s->coarse_alpha, s->gain, s->image);
        avatar_system_compose_backward(s, s->dcoarse, s->drgb_alpha,
                                       s->refined, false);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++)
            s->dfeat[C * i + k] += s->dcoarse[3 * i + k];
}

/* Composition, refiner, lookup, renderer, Phase B in reverse; the coarse
 * losses join between. */
int avatar_system_draw_backward(struct avatar_system *s, struct error *err)
{
    size_t n = s->image * s->image, C = s->channels;
    struct splat_gradients g = avatar_gradients(&s->avatar);
    struct splat_picture_gradients d = {
        s->dfeat, s->dalpha, s->photo ? s->dplace : NULL
    };
    float dturn[RELATIVE_POSE_SIZE] = {0};

    memset(s->dalpha, 0, n * sizeof *s->dalpha);
    memset(s->dshown, 0, TEXTURE_PHOTO * n * sizeof *s->dshown);
    memset(s->dverts, 0, 3 * s->head->V * sizeof *s->dverts);
    memset(s->dcam, 0, sizeof s->dcam);
    if (s->config.has_refiner)
        avatar_system_refined_backward(s, dturn);
    else
        memset(s->dfeat, 0, n * C * sizeof *s->dfeat);
    if (s->fixed)
        return 0;
    if (!s->config.has_refiner)
        image_add(s->dalpha, s->drgb_alpha, n);
    avatar_system_coarse_backward(s);
    if (s->photo) {
        memset(s->dplace, 0,
               SPLAT_PLACE_CHANNELS * n * sizeof *s->dplace);
        texture_lookup_backward(s->dplace, s->dalpha, s->dshown,
                                &s->texture, &s->view, s->place, s->alpha,
                                s->image);
    }
    avatar_relative_pose_backward(s->dcam, dturn, &s->avatar);
    g.rt = s->dcam;
    if (splat_backward(&s->splat, &g, &d, err))
        return -1;
    avatar_drive_backward(s->dverts, s->dcam, &s->avatar);
    return 0;
}

void avatar_system_bake_backward(struct avatar_system *s)
{
    if (!s->fixed)
        avatar_bake_backward(&s->avatar);
}
