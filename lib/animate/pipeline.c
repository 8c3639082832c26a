/* A frame of Phase B (pipeline.h). */
#include "lib/animate/pipeline.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/cpu.h"
#include "lib/photo/place.h"
#include "lib/splat/splat.h"

/* With the Gaussians loaded. */
static int pipeline_open_renderer(struct pipeline *p, struct error *err)
{
    const int size = (int)p->opt.size;
    const int channels = p->opt.star ? 3 : (int)p->avatar.baked->C;
    struct splat_options opt = splat_defaults(size, size, channels);
    struct gaussians g = baked_set(p->avatar.baked);

    opt.rules = p->opt.rules;
    opt.branches = p->opt.branches;
    opt.threads = p->opt.threads;
    opt.place = p->avatar.texture;
    opt.kept = true;
    opt.fixed16 = opt.fixed16 && !p->opt.f32;
    return splat_init(&p->splat, &opt, err) ||
           splat_load(&p->splat, &g, err) ? -1 : 0;
}

/* Eq. SR's input: as spid-splat writes it, so that the bytes are the same. */
static bool pipeline_open_features(struct pipeline *p)
{
    const size_t C = p->avatar.baked->C;
    const size_t n = (p->opt.size * p->opt.size * C + 31) / 32 * 32;

    if (C > SPLAT_COLORS && !p->opt.f32)
        p->features_half = aligned_alloc(64, n * sizeof *p->features_half);
    else
        p->features = malloc(n * sizeof *p->features);
    return p->features_half || p->features;
}

/* What a frame is drawn into. */
static bool pipeline_open_pictures(struct pipeline *p)
{
    const size_t pixels = p->opt.size * p->opt.size;
    const bool places = p->avatar.texture, refined = !p->opt.star;

    p->verts = malloc(3 * p->avatar.id->head->V * sizeof *p->verts);
    p->image = aligned_alloc(64, (3 * pixels * sizeof(float) + 63) / 64 * 64);
    p->alpha = malloc(pixels * sizeof *p->alpha);
    if (places)
        p->place = malloc(PLACE_CHANNELS * pixels * sizeof *p->place);
    if (places && refined)
        p->photo = malloc(TEXTURE_PHOTO * pixels * sizeof *p->photo);
    return p->verts && p->image && p->alpha && (!places || p->place) &&
           (!places || !refined || p->photo) &&
           (!refined || pipeline_open_features(p));
}

int pipeline_init(struct pipeline *p, const struct pipeline_options *opt,
                  const struct pipeline_avatar *avatar, struct error *err)
{
    *p = (struct pipeline){.opt = *opt, .avatar = *avatar};
    if (!pipeline_open_pictures(p))
        return error_set(err, EX_OSERR, "no memory for a picture of %zu "
                         "pixels", opt->size);
    if (baked_move_init(&p->move, avatar->baked, err) ||
        pipeline_open_renderer(p, err) ||
        (opt->picture > opt->size &&
         zoom_init(&p->zoom, opt->size, opt->picture, avatar->texture, err)))
        return -1;
    return opt->star ? 0 : refine_open(&p->refine, opt->model, opt->precision,
                                       opt->roi, err);
}

void pipeline_release(struct pipeline *p)
{
    splat_release(&p->splat);
    refine_release(&p->refine);
    zoom_release(&p->zoom);
    baked_move_release(&p->move);
    free(p->verts);
    free(p->image);
    free(p->alpha);
    free(p->place);
    free(p->photo);
    free(p->features);
    free(p->features_half);
    memset(p, 0, sizeof *p);
}

/* Eq. SR on what was drawn, and what the photograph shows of it. */
static int pipeline_refine(struct pipeline *p,
                           const struct splat_place_view *view,
                           struct error *err)
{
    const size_t size = p->opt.size;
    struct refine_input in = {
        .height = size, .width = size, .channels = p->avatar.baked->C,
        .f32 = p->features, .f16 = p->features_half, .alpha = p->alpha,
        .turn = p->move.relative_pose, .photo = p->photo
    };

    if (p->photo)
        texture_lookup(p->photo, p->avatar.texture, view, p->place, p->alpha,
                       size);
    if (refine_frame(p->image, &p->refine, &in, err))
        return -1;
    if (!p->zoom.to)
        return refine_photo(p->image, p->alpha, &p->refine, &in, err);
    texture_clamp_to_alpha(p->image, 3, p->alpha, size * size);
    return refine_field(&p->field, &p->refine, &in, err);
}

/* Eq. C: colours for SpiD*, features for the refiner; places, too, where
 * there is a photograph to look them up in. */
static int pipeline_splat(struct pipeline *p, const struct splat_place_view *v,
                          struct error *err)
{
    const struct splat_camera c =
        splat_camera_square(p->cam, (int)p->opt.size, CAMERA_FOCAL);
    float *image = p->opt.star ? p->image : p->features;

    return splat_draw(&p->splat, &(struct splat_pictures){
        .image = image, .half = image ? NULL : p->features_half,
        .alpha = p->alpha, .place = p->place
    }, &c, v, NULL, err);
}

/* The photograph over what was drawn, at the picture's size. */
static void pipeline_compose(struct pipeline *p,
                             const struct splat_place_view *v)
{
    const struct texture *t = p->avatar.texture;

    if (p->zoom.to)
        zoom_picture(&p->zoom, p->image, p->alpha, p->place, v, t, &p->field);
    else if (p->opt.star && p->place)
        texture_apply(p->image, 3, p->alpha, t, v, p->place, p->opt.size);
}

struct pipeline_picture pipeline_picture(const struct pipeline *p)
{
    const struct zoom *z = &p->zoom;

    return z->to ? (struct pipeline_picture){z->to, z->color, z->alpha}
                 : (struct pipeline_picture){p->opt.size, p->image, p->alpha};
}

int pipeline_draw(struct pipeline *p, struct pipeline_times *t,
                  const struct motion *m, struct error *err)
{
    const struct pipeline_avatar *a = &p->avatar;
    struct splat_place_view view;
    double t0 = cpu_seconds();

    head_pose(p->verts, a->id, &m->pose);               /* V_d */
    motion_camera(p->cam, m);                           /* T_d */
    head_mouth(&p->mouth, a->id->head, p->verts);
    double t1 = cpu_seconds();
    baked_drive(&p->move, a->baked, a->dense, p->verts, p->mouth.centre,
                p->mouth.chin, p->mouth.gap, p->opt.closed,
                p->cam);                                /* mu_D, mu_M */
    double t2 = cpu_seconds();
    place_view_make(&view, a->baked->view, p->cam);
    if (baked_move_scene(&p->splat, &p->move, a->baked, err) ||
        pipeline_splat(p, &view, err))                  /* C */
        return -1;
    double t3 = cpu_seconds();
    if (!p->opt.star && pipeline_refine(p, &view, err)) /* SR */
        return -1;
    pipeline_compose(p, &view);
    if (t)
        *t = (struct pipeline_times){
            t1 - t0, t2 - t1, t3 - t2,
            p->opt.star ? 0 : cpu_seconds() - t3
        };
    return 0;
}
