/* A frame of Phase B (pipeline.h). */
#include "lib/animate/pipeline.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/cpu.h"
#include "lib/base/relative_pose.h"
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
    opt.fixed16 = opt.fixed16 && !p->opt.f32 && !p->opt.exact;
    if (p->opt.exact) {
        opt.alpha_cut = 0x1p-24f;
        opt.t_cut = 0;
        opt.exp_degree = 5;
    }
    return splat_init(&p->splat, &opt, err) ||
           splat_load(&p->splat, &g, err) ? -1 : 0;
}

int pipeline_open_refiner(struct refine *r, const struct pipeline_options *opt,
                          struct error *err)
{
    return refine_open(r, opt->model, opt->precision, opt->roi, err);
}

int pipeline_init(struct pipeline *p, const struct pipeline_options *opt,
                  const struct pipeline_avatar *avatar, struct error *err)
{
    const size_t C = opt->star ? 3 : avatar->baked->C;
    const bool half = C > SPLAT_COLORS && !opt->f32;

    *p = (struct pipeline){.opt = *opt, .avatar = *avatar};
    p->refined.size = opt->picture;
    p->refined.texture = avatar->texture;
    p->verts = malloc(3 * avatar->id->head->V * sizeof *p->verts);
    if (!p->verts)
        return error_set(err, EX_OSERR, "no memory for a mesh");
    if (canvas_init(&p->canvas, opt->size, C, half, false, err) ||
        baked_move_init(&p->move, avatar->baked, err) ||
        pipeline_open_renderer(p, err))
        return -1;
    p->canvas.places = opt->picture && opt->picture != opt->size;
    return opt->star || opt->refine ? 0 : pipeline_open_refiner(&p->own, opt,
                                                                err);
}

void pipeline_release(struct pipeline *p)
{
    splat_release(&p->splat);
    refine_release(&p->own);
    refine_picture_release(&p->refined);
    canvas_release(&p->canvas);
    baked_move_release(&p->move);
    free(p->verts);
    memset(p, 0, sizeof *p);
}

/* What was drawn, as the refiner takes it. */
static struct feat pipeline_features(const struct pipeline *p)
{
    const struct canvas *c = &p->canvas;

    return (struct feat){
        .height = c->size, .width = c->size, .channels = c->channels,
        .f32 = c->image, .f16 = c->half, .alpha = c->alpha,
        .turn = p->move.relative_pose, .photo = c->photo, .place = c->place,
        .map = (const float *)&c->view, .gain = c->lit ? c->gain : NULL,
        .tint = c->tint
    };
}

int pipeline_refine(struct pipeline *p, struct pipeline_times *t,
                    struct error *err)
{
    const struct feat in = pipeline_features(p);
    const double begun = cpu_seconds();
    int rc = p->opt.star ? 0 : refine_picture_refine(
        &p->refined, p->opt.refine ? p->opt.refine : &p->own, &in, err);

    if (t)
        t->refine = cpu_seconds() - begun;
    return rc;
}

int pipeline_finish(struct pipeline *p, struct pipeline_times *t,
                    struct error *err)
{
    const struct feat in = pipeline_features(p);
    const double begun = cpu_seconds();
    int rc = p->opt.star ? 0 : refine_picture_finish(&p->refined, &in, err);

    if (t)
        t->refine += cpu_seconds() - begun;
    return rc;
}

struct pipeline_picture pipeline_picture(const struct pipeline *p)
{
    const struct refine_picture *r = &p->refined;
    const struct canvas *c = &p->canvas;

    return p->opt.star
         ? (struct pipeline_picture){c->size, c->image, c->alpha}
         : (struct pipeline_picture){r->width, r->color, r->coverage};
}

int pipeline_splat(struct pipeline *p, struct pipeline_times *t,
                   const struct motion *m, struct error *err)
{
    const struct pipeline_avatar *a = &p->avatar;
    struct canvas *c = &p->canvas;
    struct head_mouth mouth;
    double t0 = cpu_seconds();

    head_pose(p->verts, a->id, &m->pose);               /* V_d */
    motion_camera(p->cam, m);                           /* T_d */
    head_mouth(&mouth, a->id->head, p->verts);
    double t1 = cpu_seconds();
    baked_drive(&p->move, a->baked, a->dense, p->verts, mouth.centre,
                mouth.chin, mouth.gap, p->cam);
    double t2 = cpu_seconds();                          /* mu_D, mu_M */
    const struct splat_camera cam =
        splat_camera_square(p->cam, (int)c->size, CAMERA_FOCAL);

    const struct place_shoulders shoulders = {p->move.frame.plane,
                                              a->baked->pivot};

    place_view_make(&c->view, a->baked->view, p->cam,
                    a->baked->blended ? &shoulders : NULL);
    c->lit = baked_is_lit(a->baked);
    relative_light(c->light, a->baked->lamp, p->cam);
    if (baked_move_scene(&p->splat, &p->move, a->baked, err) ||
        canvas_draw(c, &p->splat, &cam, a->texture, !p->opt.star, err))
        return -1;                                      /* C */
    if (t)
        *t = (struct pipeline_times){
            t1 - t0, t2 - t1, cpu_seconds() - t2, 0
        };
    return 0;
}

int pipeline_draw(struct pipeline *p, const struct motion *m, struct error *err)
{
    return pipeline_splat(p, NULL, m, err) || pipeline_refine(p, NULL, err) ||
           pipeline_finish(p, NULL, err) ? -1 : 0;
}
