/* L_img and L_perc (Section 3.3) through avatar, renderer and refiner: what a
 * picture costs, and the gradient back to the Gaussians and the motion. */
#include "lib/train/avatar_system.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/slices.h"
#include "lib/geom/camera.h"

const char *const picture_term_name[PICTURE_COUNT] = {
    "coarse", "coarse_face", "final", "final_face", "perceptual", "mask",
    "square", "mouth"};

int avatar_system_init(struct avatar_system *s, struct params *ps,
                       const struct avatar_config *config,
                       const struct head *h, struct error *err)
{
    memset(s, 0, sizeof *s);
    s->config = *config;
    s->head = h;
    s->channels = config->has_refiner ? config->channels : 3;
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
    size_t S = s->config.size, N = s->avatar.dynamic.count +
                                   s->avatar.plane.count +
                                   s->avatar.mouth.count;
    const struct slice slices[] = {
        {&s->feat, n * C, false}, {&s->dfeat, n * C, false},
        {&s->alpha, n, false}, {&s->dalpha, n, false},
        {&s->rgb, 3 * n, false}, {&s->drgb, 3 * n, false},
        {&s->coarse, 3 * n, false}, {&s->dcoarse, 3 * n, false},
        {&s->target, 3 * n, false}, {&s->mask, n, false},
        {&s->means, 3 * N, false}, {&s->verts, 3 * V, false},
        {&s->dverts, 3 * V, false}, {&s->source, 3 * V, false},
        {&s->tmp, loss_pyramid_scratch(s->image, s->image), false},
        {(float **)&s->bytes, S * S, false}     /* 4 bytes a pixel */
    };

    if (slices_allocate(&s->block, slices, sizeof slices / sizeof *slices,
                        true, err))
        return -1;
    s->matte = s->bytes + 3 * S * S;
    return 0;
}

/* Exact exponentials of low degree; smooth takes the cut-offs away, so that
 * differences can be taken. */
int avatar_system_plan(struct avatar_system *s, size_t image, bool fresh,
                       bool smooth, struct nn_options opt, struct error *err)
{
    struct splat_options so = splat_defaults((int)image, (int)image,
                                             (int)s->channels);

    s->image = image;
    so.gradients = opt.mode != NN_INFER;
    so.exp_degree = 5;
    if (smooth) {
        so.alpha_cut = 1.0f / (1 << 24);
        so.t_cut = 0;
    }
    if (fresh)
        avatar_init_weights(&s->avatar);
    if (avatar_system_allocate(s, err) || avatar_plan(&s->avatar, opt, err) ||
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

void avatar_system_update(struct avatar_system *s)
{
    avatar_update(&s->avatar);
    if (s->config.has_refiner)
        refiner_update(&s->refiner);
}

void avatar_system_release(struct avatar_system *s)
{
    splat_release(&s->splat);
    if (s->config.has_refiner)
        refiner_release(&s->refiner);
    avatar_release(&s->avatar);
    if (s->perceptual.side)
        perceptual_release(&s->perceptual);
    free(s->block);
    memset(s, 0, sizeof *s);
}

/* Phase A of a training frame: its own picture is the source. */
int avatar_system_bake(struct avatar_system *s, const struct data_frame *f,
                       const struct identity *id, const struct head_motion *m,
                       const float *cam, struct error *err)
{
    size_t S = s->config.size;
    float truth_cam[12];
    struct head_motion truth;
    struct avatar_source src = {.rgb = s->bytes, .matte = s->matte,
                                .verts = s->source};

    if (f->size != S || f->width != S || f->height != S)
        return error_set(err, EX_DATAERR, "pictures of %zux%zu (expected "
                         "%zux%zu, the model's size)", f->size, f->size, S,
                         S);
    for (size_t i = 0; i < S * S; i++) {
        memcpy(s->bytes + 3 * i, f->rgba + 4 * i, 3);
        s->matte[i] = f->rgba[4 * i + 3];
    }
    data_truth(&truth, truth_cam, f);
    src.cam = m ? cam : truth_cam;
    head_pose(s->source, id, m ? m : &truth);
    avatar_bake(&s->avatar, &src);
    return splat_load(&s->splat, &s->avatar.set, err);
}

/* Phase B: drive, render, refine. */
int avatar_system_draw(struct avatar_system *s, const float *verts,
                       const float cam[12], struct error *err)
{
    struct avatar *a = &s->avatar;
    size_t n = s->image * s->image, C = s->channels;
    struct splat_camera sc = splat_camera_square(cam, (int)s->image,
                                                 CAMERA_FOCAL);
    float turn[RELATIVE_POSE_SIZE];

    avatar_drive(s->means, a, verts, cam);
    if (splat_update(&s->splat, s->means, 0, a->set.n, err) ||
        splat_forward(&s->splat, s->feat, s->alpha, NULL, &sc, NULL, err))
        return -1;
    for (size_t i = 0; i < n; i++)
        memcpy(s->coarse + 3 * i, s->feat + C * i, 3 * sizeof *s->coarse);
    if (!s->config.has_refiner) {
        memcpy(s->rgb, s->coarse, 3 * n * sizeof *s->rgb);
        return 0;
    }
    avatar_relative_pose(turn, a, cam);
    refiner_turn(&s->refiner, turn);
    refiner_forward(s->rgb, s->feat, &s->refiner);
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
    terms[PICTURE_MASK] += loss_mask(s->dalpha, s->alpha, s->mask, n,
                                     c->silhouette * scale);
}

/* Teeth and tongue are some hundred pixels of many thousands, and what is the
 * median of a colour is grey: the open mouth as a picture of its own. */
static void avatar_system_mouth_losses(struct avatar_system *s, double *terms,
                                       const struct data_frame *f,
                                       const struct train_config *c,
                                       double scale)
{
    size_t S = s->image;
    struct box box = data_mouth(f, S);
    float *d[2] = {s->dcoarse, s->drgb}, *y[2] = {s->coarse, s->rgb};

    if (c->mouth == 0 || box_is_empty(box))
        return;
    for (int i = 0; i < (s->config.has_refiner ? 2 : 1); i++) {
        terms[PICTURE_MOUTH] += loss_l1(d[i], y[i], s->target, S, S, &box,
                                        c->mouth * scale);
        terms[PICTURE_MOUTH] += loss_pyramid(d[i], y[i], s->target, S, S,
                                             &box, 0.5 * c->mouth * scale,
                                             s->tmp);
    }
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

/* L_img and L_perc of coarse and refined picture, silhouette, mouth. */
int avatar_system_losses(struct avatar_system *s, double *terms,
                         const struct data_frame *f,
                         const struct train_config *c, double scale,
                         struct error *err)
{
    size_t S = s->image, n = S * S;
    struct box face = data_face(f, S);

    if (data_portrait(s->target, s->mask, S, f, err))
        return -1;
    memset(s->dcoarse, 0, 3 * n * sizeof *s->dcoarse);
    memset(s->drgb, 0, 3 * n * sizeof *s->drgb);
    memset(s->dalpha, 0, n * sizeof *s->dalpha);
    if (c->smooth) {
        avatar_system_smooth_losses(s, terms, c, scale);
        return 0;
    }
    terms[PICTURE_COARSE] += loss_l1(s->dcoarse, s->coarse, s->target, S, S,
                                     NULL, c->coarse * scale);
    terms[PICTURE_COARSE_FACE] += loss_l1(s->dcoarse, s->coarse, s->target,
                                          S, S, &face,
                                          c->coarse * c->face * scale);
    if (s->perceptual.side && c->perceptual > 0)
        perceptual_target(&s->perceptual, s->target, S, S, &face);
    terms[PICTURE_PERCEPTUAL] += avatar_system_perceptual_loss(
        s, s->dcoarse, s->coarse, &face, c->perceptual * scale);
    terms[PICTURE_MASK] += loss_mask(s->dalpha, s->alpha, s->mask, n,
                                     c->silhouette * scale);
    terms[PICTURE_SQUARE] += loss_l2(s->dcoarse, s->coarse, s->target, 3 * n,
                                     c->square * scale);
    avatar_system_mouth_losses(s, terms, f, c, scale);
    if (!s->config.has_refiner)
        return 0;
    terms[PICTURE_SQUARE] += loss_l2(s->drgb, s->rgb, s->target, 3 * n,
                                     c->square * scale);
    terms[PICTURE_FINAL] += loss_l1(s->drgb, s->rgb, s->target, S, S, NULL,
                                    c->refined * scale);
    terms[PICTURE_FINAL_FACE] += loss_l1(s->drgb, s->rgb, s->target, S, S,
                                         &face, c->refined * c->face * scale);
    terms[PICTURE_PERCEPTUAL] += avatar_system_perceptual_loss(
        s, s->drgb, s->rgb, &face, c->perceptual * scale);
    return 0;
}

/* Refiner, renderer, Phase B in reverse; the coarse losses join between the
 * first two. */
int avatar_system_draw_backward(struct avatar_system *s, struct error *err)
{
    size_t n = s->image * s->image, C = s->channels;
    struct splat_gradients g = avatar_gradients(&s->avatar);
    float dturn[RELATIVE_POSE_SIZE] = {0};

    if (s->config.has_refiner)
        refiner_backward(s->dfeat, dturn, s->drgb, &s->refiner);
    else
        memset(s->dfeat, 0, n * C * sizeof *s->dfeat);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++)
            s->dfeat[C * i + k] += s->dcoarse[3 * i + k];
    memset(s->dcam, 0, sizeof s->dcam);
    avatar_relative_pose_backward(s->dcam, dturn, &s->avatar);
    memset(s->dverts, 0, 3 * s->head->V * sizeof *s->dverts);
    g.rt = s->dcam;
    if (splat_backward(&s->splat, &g, s->dfeat, s->dalpha, err))
        return -1;
    avatar_drive_backward(s->dverts, s->dcam, &s->avatar);
    return 0;
}

void avatar_system_bake_backward(struct avatar_system *s)
{
    avatar_bake_backward(&s->avatar);
}
