#include "lib/train/trainee.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"

const char *const picture_term_name[PICTURE_COUNT] = {
    "coarse", "coarse_face", "final", "final_face", "perceptual", "mask",
    "square", "mouth"};

int trainee_init(struct trainee *t, struct params *ps,
                 const struct avatar_config *config, const struct head *h,
                 struct error *err)
{
    memset(t, 0, sizeof *t);
    t->config = *config;
    t->head = h;
    t->channels = config->has_refiner ? config->channels : 3;
    if (avatar_init(&t->avatar, ps, config, h, err))
        return -1;
    return config->has_refiner
               ? refiner_init(&t->refiner, ps, "refine.", &config->refiner,
                              err)
               : 0;
}

/* Point the arrays into one block. */
static int allocate(struct trainee *t, struct error *err)
{
    size_t n = t->image * t->image, C = t->channels, V = t->head->V;
    size_t S = t->config.size, n1 = t->config.plane, K = t->config.mouth;
    size_t N = V + t->avatar.dense.E + n1 * n1 + K * K;
    size_t part[] = {n * C, n * C, n, n, 3 * n, 3 * n, 3 * n, 3 * n, 3 * n,
                     n, 3 * N, 3 * V, 3 * V, 3 * V,
                     loss_pyramid_scratch(t->image, t->image)};
    float **to[] = {&t->feat, &t->dfeat, &t->alpha, &t->dalpha, &t->rgb,
                    &t->drgb, &t->coarse, &t->dcoarse, &t->target, &t->mask,
                    &t->means, &t->verts, &t->dverts, &t->source, &t->tmp};
    size_t total = 0, count = sizeof part / sizeof *part;
    float *block;

    for (size_t i = 0; i < count; i++)
        total += part[i] = (part[i] + 15) / 16 * 16;
    block = calloc(total, sizeof *block);
    t->bytes = malloc(4 * S * S);
    if (!block || !t->bytes) {
        free(block);
        return error_set(err, EX_OSERR, "out of memory (%zu floats)", total);
    }
    for (size_t i = 0; i < count; i++) {
        *to[i] = block;
        block += part[i];
    }
    t->matte = t->bytes + 3 * S * S;
    return 0;
}

int trainee_plan(struct trainee *t, size_t image, int fresh, int smooth,
                 struct nn_options opt, struct error *err)
{
    struct splat_options so = splat_defaults((int)image, (int)image,
                                             (int)t->channels);

    t->image = image;
    so.gradients = opt.mode != NN_INFER;
    so.exp_degree = 5;
    if (smooth) {
        so.alpha_cut = 1.0f / (1 << 24);
        so.t_cut = 0;
    }
    if (fresh)
        avatar_start(&t->avatar);
    if (allocate(t, err) || avatar_plan(&t->avatar, opt, err) ||
        (t->config.has_refiner &&
         refiner_plan(&t->refiner, 1, image, image, opt, err)))
        return -1;
    return splat_init(&t->splat, &so, err);
}

void trainee_update(struct trainee *t)
{
    avatar_update(&t->avatar);
    if (t->config.has_refiner)
        refiner_update(&t->refiner);
}

void trainee_release(struct trainee *t)
{
    splat_release(&t->splat);
    if (t->config.has_refiner)
        refiner_release(&t->refiner);
    avatar_release(&t->avatar);
    free(t->feat);              /* the block */
    free(t->bytes);
    memset(t, 0, sizeof *t);
}

int trainee_bake(struct trainee *t, const struct data_frame *f,
                 const struct identity *id, const struct head_motion *m,
                 const float *cam, struct error *err)
{
    size_t S = t->config.size;
    float truth_cam[12];
    struct head_motion truth;
    struct avatar_source src = {.rgb = t->bytes, .matte = t->matte,
                                .verts = t->source};

    if (f->size != S || f->width != S || f->height != S)
        return error_set(err, EX_DATAERR, "pictures of %zux%zu (expected "
                         "%zux%zu, the model's size)", f->size, f->size, S,
                         S);
    for (size_t i = 0; i < S * S; i++) {
        memcpy(t->bytes + 3 * i, f->rgba + 4 * i, 3);
        t->matte[i] = f->rgba[4 * i + 3];
    }
    data_truth(&truth, truth_cam, f);
    src.cam = m ? cam : truth_cam;
    head_pose(t->source, id, m ? m : &truth);
    avatar_bake(&t->avatar, &src);
    return splat_load(&t->splat, &t->avatar.set, err);
}

int trainee_draw(struct trainee *t, const float *verts, const float cam[12],
                 struct error *err)
{
    struct avatar *a = &t->avatar;
    size_t n = t->image * t->image, C = t->channels;
    struct splat_camera sc = splat_camera_square(cam, (int)t->image,
                                                 CAMERA_FOCAL);
    float turn[TURN_COUNT];

    avatar_drive(t->means, a, verts, cam);
    if (splat_update(&t->splat, t->means, 0, a->set.n, err) ||
        splat_forward(&t->splat, t->feat, t->alpha, NULL, &sc, NULL, err))
        return -1;
    for (size_t i = 0; i < n; i++)
        memcpy(t->coarse + 3 * i, t->feat + C * i, 3 * sizeof *t->coarse);
    if (!t->config.has_refiner) {
        memcpy(t->rgb, t->coarse, 3 * n * sizeof *t->rgb);
        return 0;
    }
    avatar_turn(turn, a, cam);
    refiner_turn(&t->refiner, turn);
    refiner_forward(t->rgb, t->feat, &t->refiner);
    return 0;
}

/* Mean square instead, of the whole picture: see train_config.smooth. */
static void smooth_losses(struct trainee *t, double *terms,
                          const struct train_config *c, double scale)
{
    size_t n = t->image * t->image;

    terms[PICTURE_COARSE] += loss_l2(t->dcoarse, t->coarse, t->target, 3 * n,
                                     c->coarse * scale);
    terms[PICTURE_FINAL] += loss_l2(t->drgb, t->rgb, t->target, 3 * n,
                                    c->refined * scale);
    terms[PICTURE_MASK] += loss_mask(t->dalpha, t->alpha, t->mask, n,
                                     c->silhouette * scale);
}

/* Teeth and tongue are some hundred pixels of many thousands, and what is the
 * median of a colour is grey: the open mouth as a picture of its own. */
static void mouth_losses(struct trainee *t, double *terms,
                         const struct data_frame *f,
                         const struct train_config *c, double scale)
{
    size_t S = t->image;
    struct box box = data_mouth(f, S);
    float *d[2] = {t->dcoarse, t->drgb}, *y[2] = {t->coarse, t->rgb};

    if (c->mouth == 0 || box_is_empty(box))
        return;
    for (int i = 0; i < (t->config.has_refiner ? 2 : 1); i++) {
        terms[PICTURE_MOUTH] += loss_l1(d[i], y[i], t->target, S, S, &box,
                                        c->mouth * scale);
        terms[PICTURE_MOUTH] += loss_pyramid(d[i], y[i], t->target, S, S,
                                             &box, 0.5 * c->mouth * scale,
                                             t->tmp);
    }
}

int trainee_losses(struct trainee *t, double *terms,
                   const struct data_frame *f, const struct train_config *c,
                   double scale, struct error *err)
{
    size_t S = t->image, n = S * S;
    struct box face = data_face(f, S);

    if (data_portrait(t->target, t->mask, S, f, err))
        return -1;
    memset(t->dcoarse, 0, 3 * n * sizeof *t->dcoarse);
    memset(t->drgb, 0, 3 * n * sizeof *t->drgb);
    memset(t->dalpha, 0, n * sizeof *t->dalpha);
    if (c->smooth) {
        smooth_losses(t, terms, c, scale);
        return 0;
    }
    terms[PICTURE_COARSE] += loss_l1(t->dcoarse, t->coarse, t->target, S, S,
                                     NULL, c->coarse * scale);
    terms[PICTURE_COARSE_FACE] += loss_l1(t->dcoarse, t->coarse, t->target,
                                          S, S, &face,
                                          c->coarse * c->face * scale);
    terms[PICTURE_PERCEPTUAL] += loss_pyramid(t->dcoarse, t->coarse,
                                              t->target, S, S, &face,
                                              c->perceptual * scale, t->tmp);
    terms[PICTURE_MASK] += loss_mask(t->dalpha, t->alpha, t->mask, n,
                                     c->silhouette * scale);
    terms[PICTURE_SQUARE] += loss_l2(t->dcoarse, t->coarse, t->target, 3 * n,
                                     c->square * scale);
    mouth_losses(t, terms, f, c, scale);
    if (!t->config.has_refiner)
        return 0;
    terms[PICTURE_SQUARE] += loss_l2(t->drgb, t->rgb, t->target, 3 * n,
                                     c->square * scale);
    terms[PICTURE_FINAL] += loss_l1(t->drgb, t->rgb, t->target, S, S, NULL,
                                    c->refined * scale);
    terms[PICTURE_FINAL_FACE] += loss_l1(t->drgb, t->rgb, t->target, S, S,
                                         &face, c->refined * c->face * scale);
    terms[PICTURE_PERCEPTUAL] += loss_pyramid(t->drgb, t->rgb, t->target, S,
                                              S, &face, c->perceptual * scale,
                                              t->tmp);
    return 0;
}

int trainee_draw_backward(struct trainee *t, struct error *err)
{
    size_t n = t->image * t->image, C = t->channels;
    struct splat_gradients g = avatar_gradients(&t->avatar);
    float dturn[TURN_COUNT] = {0};

    if (t->config.has_refiner)
        refiner_backward(t->dfeat, dturn, t->drgb, &t->refiner);
    else
        memset(t->dfeat, 0, n * C * sizeof *t->dfeat);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++)
            t->dfeat[C * i + k] += t->dcoarse[3 * i + k];
    memset(t->dcam, 0, sizeof t->dcam);
    avatar_turn_backward(t->dcam, dturn, &t->avatar);
    memset(t->dverts, 0, 3 * t->head->V * sizeof *t->dverts);
    g.rt = t->dcam;
    if (splat_backward(&t->splat, &g, t->dfeat, t->dalpha, err))
        return -1;
    avatar_drive_backward(t->dverts, t->dcam, &t->avatar);
    return 0;
}

void trainee_bake_backward(struct trainee *t)
{
    avatar_bake_backward(&t->avatar);
}
