/* The narrow refiner (Eq. SR): its layers in the order of the forward pass,
 * and the same lines backwards. */
#include "lib/net/narrow_refiner.h"

#include <string.h>
#include <sysexits.h>

#include "lib/nn/image.h"
#include "lib/nn/kernels.h"


/* A layer as it is declared. */
struct narrow_refiner_row {
    struct conv *conv;
    const char *name;
    size_t in, out, kernel, stride;
    enum nn_act act;
};

/* One convolution, "<prefix><name>.*". */
static void narrow_refiner_declare(const struct narrow_refiner_row *row,
                                   struct params *ps, const char *prefix)
{
    char name[120];
    struct conv *c = row->conv;

    nn_name(name, "%s%s", prefix, row->name);
    conv_init(c, ps, name, row->in, row->out, row->kernel, row->stride, true);
    c->act = row->act;
    c->pad = row->kernel == 2 ? CONV_NONE : CONV_HALF;
    ps->tensor[c->weight].gain = c->act == ACT_LRELU ? ACT_LRELU_GAIN : 0.1f;
}

/* All of them, those of the photograph last. */
static void narrow_refiner_declare_all(struct narrow_refiner *r,
                                       struct params *ps, const char *prefix)
{
    const size_t w0 = r->width, w1 = r->width * 3 / 2, w2 = 2 * r->width;
    const struct narrow_refiner_row rows[] = {
        { &r->stem0, "fold.0", r->channels, w0 / 2, 2, 2, ACT_LRELU },
        { &r->stem1, "fold.1", w0 / 2, w0, 2, 2, ACT_LRELU },
        { &r->down1, "down.1", w0, w1, 3, 2, ACT_LRELU },
        { &r->down2, "down.2", w1, w2, 3, 2, ACT_LRELU },
        { &r->mid, "mid", w2, w2, 3, 1, ACT_LRELU },
        { &r->style.reduce, "style.0", w2, w2, 1, 1, ACT_LRELU },
        { &r->style.expand, "style.1", w2, w2, 1, 1, ACT_NONE },
        { &r->step[1].up, "up.2", w2, w1, 3, 1, ACT_LRELU },
        { &r->step[1].condition, "condition.1", w1, 2 * w1, 1, 1, ACT_NONE },
        { &r->step[1].body, "body.1", w1, w1, 3, 1, ACT_LRELU },
        { &r->step[0].up, "up.1", w1, w0, 1, 1, ACT_LRELU },
        { &r->step[0].condition, "condition.0", w0, 2 * w0, 1, 1, ACT_NONE },
        { &r->step[0].body, "body.0", w0, w0, 3, 1, ACT_LRELU },
        { &r->rgb, "rgb", w0, r->photos ? 3 : NARROW_END_COLORS, 3, 1,
          ACT_NONE },
        { &r->photo0, "photo.0", NARROW_REFINER_PHOTO, w0 / 2, 2, 2,
          ACT_LRELU },
        { &r->photo1, "photo.1", w0 / 2, w0, 2, 2, ACT_LRELU },
        { &r->field, "field", w0, NARROW_REFINER_FIELD, 3, 1, ACT_NONE },
    };
    const size_t count = sizeof rows / sizeof *rows - (r->photos ? 0 : 3);

    for (size_t i = 0; i < count; i++)
        narrow_refiner_declare(&rows[i], ps, prefix);
}

void narrow_refiner_init(struct narrow_refiner *r, struct params *ps,
                         const char *prefix, size_t channels, size_t width,
                         bool turns, bool photos)
{
    char name[120];

    memset(r, 0, sizeof *r);
    r->ps = ps;
    r->channels = channels;
    r->width = width;
    r->turns = turns;
    r->photos = photos;
    r->step[0].width = width;
    r->step[1].width = width * 3 / 2;
    narrow_refiner_declare_all(r, ps, prefix);
    r->mid.add = true;
    r->style.additive = true;
    for (int i = 1; turns && i >= 0; i--)
        conditional_conv_init(&r->step[i].conditional, &r->step[i].condition,
                              nn_name(name, "%scondition.%d", prefix, i),
                              RELATIVE_POSE_SIZE);
    /* training starts from the coarse picture */
    ps->tensor[r->rgb.weight].init = PARAM_ZERO;
    if (!photos)
        return;
    /* ... and from what a refiner without the photograph makes of it */
    ps->tensor[r->photo1.weight].init = PARAM_ZERO;
    ps->tensor[r->field.weight].init = PARAM_ZERO;
    r->stem1.act = ACT_NONE;        /* after the photograph has joined */
    r->photo1.add = true;
}

/* The way down: the features, to a quarter in size with the photograph beside
 * them, to an eighth, to a sixteenth. */
static void narrow_refiner_plan_down(struct narrow_refiner *r)
{
    struct nn_plan *p = &r->plan;
    size_t B = r->batch, h = r->h, w = r->w, w0 = r->width, w2 = 2 * w0;
    size_t w1 = w0 * 3 / 2, a0 = B * h * w / 16, a1 = a0 / 4, a2 = a1 / 4;

    r->f0 = nn_plan_map(p, 4 * a0 * (w0 / 2));
    r->fused = !nn_plan_backward(p) && fused_stem_possible(&r->stem0);
    if (r->fused)
        fused_stem_plan(&r->stem, &r->stem0, p, B, h, w);
    else
        conv_plan(&r->stem0, p, B, h, w);
    r->e0 = nn_plan_map(p, a0 * w0);
    conv_plan(&r->stem1, p, B, h / 2, w / 2);
    nn_plan_recycle(p, r->f0);
    if (r->photos) {
        r->p0 = nn_plan_map(p, 4 * a0 * (w0 / 2));
        conv_plan(&r->photo0, p, B, h, w);
        conv_plan(&r->photo1, p, B, h / 2, w / 2);
        nn_plan_recycle(p, r->p0);
    }
    r->e1 = nn_plan_map(p, a1 * w1);
    conv_plan(&r->down1, p, B, h / 4, w / 4);
    r->e2 = nn_plan_map(p, a2 * w2);
    conv_plan(&r->down2, p, B, h / 8, w / 8);
}

/* At a sixteenth: the middle, its mean as a style, and the style's use. */
static void narrow_refiner_plan_middle(struct narrow_refiner *r)
{
    struct nn_plan *p = &r->plan;
    size_t B = r->batch, h = r->h, w = r->w, w2 = 2 * r->width;
    size_t a2 = B * h * w / 256;

    r->m = nn_plan_map(p, a2 * w2);
    conv_plan(&r->mid, p, B, h / 16, w / 16);
    squeeze_excite_plan(&r->style, p, B, h * w / 256);
    r->ms = nn_plan_map(p, a2 * w2);
}

/* From h x w pixels to twice as many. */
static void narrow_step_plan(struct narrow_step *s, struct nn_plan *p,
                             size_t B, size_t h, size_t w)
{
    const size_t C = s->width, few = B * h * w, a = 4 * few;

    s->c = nn_plan_map(p, few * C);
    conv_plan(&s->up, p, B, h, w);
    s->r = nn_plan_map(p, a * C);
    rescale_plan(&s->grow, p, RESCALE_BILINEAR, B, h, w, 2 * h, 2 * w, C);
    s->t = nn_plan_map(p, a * 2 * C);
    conv_plan(&s->condition, p, B, 2 * h, 2 * w);
    s->y = nn_plan_map(p, a * C);
    s->z = nn_plan_map(p, a * C);
    conv_plan(&s->body, p, B, 2 * h, 2 * w);
}

static void narrow_refiner_plan_up(struct narrow_refiner *r)
{
    struct nn_plan *p = &r->plan;
    size_t B = r->batch, h = r->h, w = r->w, a0 = B * h * w / 16;

    for (int i = 1; i >= 0; i--)
        narrow_step_plan(&r->step[i], p, B, h >> (i + 3), w >> (i + 3));
    r->d = nn_plan_map(p, a0 * NARROW_END_COLORS);
    if (r->photos)
        r->tint = nn_plan_map(p, a0 * 3);
    conv_plan(&r->rgb, p, B, h / 4, w / 4);
}

/* The conditional convolutions' weights for the relative pose in r. */
static void narrow_refiner_set_turn(void *refiner)
{
    struct narrow_refiner *r = refiner;

    for (int i = 1; i >= 0; i--)
        conditional_conv_set(&r->step[i].conditional, r->turn);
}

/* The maps and layers in the order of the forward pass. */
static void narrow_refiner_plan_forward(struct narrow_refiner *r)
{
    struct nn_plan *p = &r->plan;
    size_t B = r->batch, h = r->h, w = r->w;

    if (r->turns)
        nn_plan_layer(p, (struct nn_layer){r, narrow_refiner_set_turn, NULL});
    narrow_refiner_plan_down(r);
    narrow_refiner_plan_middle(r);
    narrow_refiner_plan_up(r);
    if (r->photos) {
        r->k = nn_plan_floats(p, B * h * w / 16 * NARROW_REFINER_FIELD);
        conv_plan(&r->field, p, B, h / 4, w / 4);
    }
    narrow_end_plan(&r->end, &r->rgb, r->photos ? &r->field : NULL,
                    NARROW_REFINER_MAX, p);
    for (int i = 1; r->turns && i >= 0; i--)
        conditional_conv_plan(&r->step[i].conditional, p);
}

/* Gradients on their way, at the three scales. */
static void narrow_refiner_plan_backward(struct narrow_refiner *r)
{
    struct nn_plan *p = &r->plan;
    size_t w0 = r->width, a0 = r->batch * r->h * r->w / 16;

    for (int i = 0; i < 2; i++) {
        struct narrow_step *s = &r->step[i];
        const size_t n = (a0 >> 2 * i) * s->width;

        s->dc = nn_plan_floats(p, n / 4);
        s->dt = nn_plan_floats(p, 2 * n);
        s->dy = nn_plan_floats(p, n);
        s->dz = nn_plan_floats(p, n);
        s->de = nn_plan_floats(p, n);
    }
    r->dm = nn_plan_floats(p, a0 / 16 * 2 * w0);
    r->de2 = nn_plan_floats(p, a0 / 16 * 2 * w0);
    r->df = nn_plan_floats(p, 4 * a0 * (w0 / 2));
    r->dd = nn_plan_floats(p, a0 * NARROW_END_COLORS);
    if (r->photos) {
        r->dtint = nn_plan_floats(p, a0 * 3);
        r->dp = nn_plan_floats(p, 4 * a0 * (w0 / 2));
        r->dk = nn_plan_floats(p, a0 * NARROW_REFINER_FIELD);
    }
}

int narrow_refiner_plan(struct narrow_refiner *r, size_t batch, size_t h,
                        size_t w, struct nn_options opt, struct error *err)
{
    if (h % 32 || w % 32 || !h || !w)
        return error_set(err, EX_DATAERR, "the refiner cannot take %zux%zu "
                         "pixels (expected multiples of 32)", w, h);
    nn_plan_release(&r->plan);
    nn_plan_init(&r->plan, opt);
    r->batch = batch;
    r->h = h;
    r->w = w;
    narrow_refiner_plan_forward(r);
    if (nn_plan_backward(&r->plan))
        narrow_refiner_plan_backward(r);
    return nn_plan_finish(&r->plan, err);
}

void narrow_refiner_turn(struct narrow_refiner *r,
                         const float turn[RELATIVE_POSE_SIZE])
{
    if (!r->turns || !memcmp(r->turn, turn, sizeof r->turn))
        return;
    memcpy(r->turn, turn, sizeof r->turn);
    narrow_refiner_set_turn(r);
    for (int i = 1; i >= 0; i--)
        conv_update(&r->step[i].condition);
}

void narrow_refiner_release(struct narrow_refiner *r)
{
    nn_plan_release(&r->plan);
    memset(r, 0, sizeof *r);
}

/* s->z from the map x of the step before and e (places,width) of the way
 * down. */
static void narrow_step_forward(struct narrow_step *s, const float *x,
                                const float *e, size_t places)
{
    conv_forward(s->c, x, &s->up);
    rescale_forward(s->r, s->c, &s->grow);
    conv_forward(s->t, e, &s->condition);
    sft_forward(s->y, s->r, s->t, 1, places, s->width);
    conv_forward(s->z, s->y, &s->body);
}

/* From e0, a quarter of the size, to sixteen pixels' corrections per place. */
static void narrow_refiner_forward_quarter(struct narrow_refiner *r)
{
    size_t w0 = r->width, a0 = r->batch * r->h * r->w / 16, a2 = a0 / 16;

    /* down */
    conv_forward(r->e1, r->e0, &r->down1);
    conv_forward(r->e2, r->e1, &r->down2);
    memcpy(r->m, r->e2, a2 * 2 * w0 * sizeof(float));
    conv_forward(r->m, r->e2, &r->mid);             /* lrelu(e2 + conv e2) */
    squeeze_excite_forward(r->ms, r->m, &r->style);
    /* up, conditioned on the encoder's maps */
    narrow_step_forward(&r->step[1], r->ms, r->e1, a0 / 4);
    narrow_step_forward(&r->step[0], r->step[1].z, r->e0, a0);
}

/* The picture's corrections, added to rgb, and the field. */
static void narrow_refiner_forward_end(float *rgb, const float *coarse,
                                       size_t channels,
                                       struct narrow_refiner *r)
{
    const float *z = r->step[0].z;

    conv_forward(r->photos ? r->tint : r->d, z, &r->rgb);
    if (r->photos) {
        conv_forward(r->k, z, &r->field);
        narrow_end_spread(r->d, r->tint, NARROW_REFINER_MAX,
                          r->batch * r->h * r->w / 16);
    }
    depth_to_space_add(rgb, coarse, channels, r->d, r->batch, r->h / 4,
                       r->w / 4, 3, 4);
}

/* e0, a quarter of the size, from f0 and the photograph. */
static void narrow_refiner_forward_stem(struct narrow_refiner *r)
{
    conv_forward(r->e0, r->f0, &r->stem1);
    if (!r->photos)
        return;
    conv_forward(r->p0, r->photo, &r->photo0);
    conv_forward(r->e0, r->p0, &r->photo1);         /* lrelu(e0 + conv p0) */
}

bool narrow_refiner_views(const struct narrow_refiner *r)
{
    return r->fused;
}

void narrow_refiner_forward_view(float *rgb, const struct feature_view *feat,
                                 struct narrow_refiner *r)
{
    fused_stem_forward(r->f0, rgb, feat, &r->stem);
    narrow_refiner_forward_stem(r);
    narrow_end_set_coverage(&r->end, &r->step[0].body, feat->alpha,
                            feat->stride / r->channels);
    narrow_refiner_forward_quarter(r);
    if (r->end.joint.u)
        narrow_end_forward(rgb, r->k, r->step[0].z, &r->end);
    else
        narrow_refiner_forward_end(rgb, rgb, 3, r);
}

void narrow_refiner_forward(float *rgb, const float *feat,
                            struct narrow_refiner *r)
{
    struct feature_view view = { .f32 = feat, .stride = r->w * r->channels };

    r->feat = feat;
    if (r->fused) {
        narrow_refiner_forward_view(rgb, &view, r);
        return;
    }
    conv_forward(r->f0, feat, &r->stem0);
    narrow_refiner_forward_stem(r);
    narrow_refiner_forward_quarter(r);
    narrow_refiner_forward_end(rgb, feat, r->channels, r);
}

/* From s->dz to s->de and dx, the gradients of narrow_step_forward's e and x. */
static void narrow_step_backward(float *dx, struct narrow_step *s,
                                 const float *x, const float *e, size_t places,
                                 struct narrow_refiner *r)
{
    conv_backward(s->dy, s->dz, s->z, s->y, &s->body);
    sft_backward(s->dy, s->dt, s->dy, s->r, s->t, 1, places, s->width);
    if (r->turns)
        conditional_conv_backward(s->de, r->dturn, s->dt, s->t, e, r->turn,
                                  &s->conditional);
    else
        conv_backward(s->de, s->dt, s->t, e, &s->condition);
    rescale_backward(s->dc, s->dy, &s->grow);
    conv_backward(dx, s->dc, s->c, x, &s->up);
}

/* The forward pass's lines from the last to the first, to r->dm. */
static void narrow_refiner_decoder_backward(const float *drgb,
                                            const float *dfield,
                                            struct narrow_refiner *r)
{
    struct narrow_step *quarter = &r->step[0], *eighth = &r->step[1];
    size_t a0 = r->batch * r->h * r->w / 16;
    float *dz = quarter->dz, *more = quarter->de;

    space_to_depth(r->dd, drgb, r->batch, r->h, r->w, 3, 4);
    if (r->photos) {
        narrow_end_spread_backward(r->dtint, r->dd, r->tint,
                                   NARROW_REFINER_MAX, a0);
        conv_backward(dz, r->dtint, r->tint, quarter->z, &r->rgb);
        memcpy(r->dk, dfield, a0 * NARROW_REFINER_FIELD * sizeof *r->dk);
        conv_backward(more, r->dk, r->k, quarter->z, &r->field);
        image_add(dz, more, a0 * r->width);
    } else {
        conv_backward(dz, r->dd, r->d, quarter->z, &r->rgb);
    }
    narrow_step_backward(eighth->dz, quarter, eighth->z, r->e0, a0, r);
    narrow_step_backward(r->dm, eighth, r->ms, r->e1, a0 / 4, r);
}

/* From de0 to the photograph (dphoto written unless NULL); de0 becomes the
 * gradient of what stem1 gave. */
static void narrow_refiner_photo_backward(float *dphoto, float *de0,
                                          struct narrow_refiner *r)
{
    conv_backward(r->dp, de0, r->e0, r->p0, &r->photo1);
    conv_backward(dphoto, r->dp, r->p0, r->photo, &r->photo0);
}

void narrow_refiner_backward(float *dfeat, float *dphoto, const float *drgb,
                             const float *dfield, struct narrow_refiner *r)
{
    struct narrow_step *quarter = &r->step[0], *eighth = &r->step[1];
    size_t a0 = r->batch * r->h * r->w / 16, C = r->channels;
    float *de0 = quarter->de, *de1 = eighth->de;

    memset(r->dturn, 0, sizeof r->dturn);
    narrow_refiner_decoder_backward(drgb, dfield, r);
    squeeze_excite_backward(r->dm, r->dm, r->m, &r->style);
    conv_backward(r->de2, r->dm, r->m, r->e2, &r->mid);
    image_add(r->de2, r->dm, a0 / 16 * 2 * r->width);
    conv_backward(eighth->dz, r->de2, r->e2, r->e1, &r->down2);
    image_add(de1, eighth->dz, a0 / 4 * eighth->width);
    conv_backward(quarter->dz, de1, r->e1, r->e0, &r->down1);
    image_add(de0, quarter->dz, a0 * quarter->width);
    if (r->photos)
        narrow_refiner_photo_backward(dphoto, de0, r);
    conv_backward(r->df, de0, r->e0, r->f0, &r->stem1);
    conv_backward(dfeat, r->df, r->f0, r->feat, &r->stem0);
    if (!dfeat)
        return;
    /* rgb = feat's first three + correction */
    for (size_t i = 0; i < r->batch * r->h * r->w; i++)
        for (size_t c = 0; c < 3; c++)
            dfeat[i * C + c] += drgb[i * 3 + c];
}

/* ---- as a graph ---------------------------------------------------------- */

/* To h x w pixels: body(r (1 + s) + t), s and t the halves of what the
 * condition's layer makes of the map e. */
static int narrow_step_graph(struct graph *g, int x, int e, int turn, size_t h,
                             size_t w, const struct narrow_step *step)
{
    const size_t C = step->width;
    int r = graph_resize(g, graph_conv(g, x, &step->up), C, h, w);
    int st = turn < 0 ? graph_conv(g, e, &step->condition)
                      : graph_conditional_conv(g, e, turn, &step->conditional);
    int s = GRAPH_NODE(g, "Add", graph_slice(g, st, 0, C),
                       graph_real(g, 1));

    x = GRAPH_NODE(g, "Add", GRAPH_NODE(g, "Mul", r, s),
                   graph_slice(g, st, C, 2 * C));
    return graph_conv(g, x, &step->body);
}

/* The way down to a quarter. */
static int narrow_refiner_stem_graph(struct graph *g, int features, size_t h,
                                     size_t w, const struct narrow_refiner *r)
{
    int e0 = graph_conv(g, graph_conv(g, features, &r->stem0), &r->stem1);

    if (!r->photos)
        return e0;
    int photo = GRAPH_INPUT(g, "photo", 1, h, w, NARROW_REFINER_PHOTO);
    int p0 = graph_conv(g, graph_maps(g, photo), &r->photo0);
    return graph_conv_add(g, e0, p0, &r->photo1);
}

void narrow_refiner_graph(struct graph *g, size_t h, size_t w,
                          const struct narrow_refiner *r)
{
    int features = graph_maps(g, GRAPH_INPUT(g, "features", 1, h, w,
                                             r->channels));
    int turn = r->turns ? GRAPH_INPUT(g, "turn", RELATIVE_POSE_SIZE) : -1;
    int e0 = narrow_refiner_stem_graph(g, features, h, w, r);
    int e1 = graph_conv(g, e0, &r->down1);
    int e2 = graph_conv(g, e1, &r->down2);
    int m = graph_conv_add(g, e2, e2, &r->mid);
    int x = graph_squeeze_excite(g, m, &r->style);

    x = narrow_step_graph(g, x, e1, turn, h / 8, w / 8, &r->step[1]);
    x = narrow_step_graph(g, x, e0, turn, h / 4, w / 4, &r->step[0]);
    int d = graph_conv(g, x, &r->rgb);
    if (r->photos) {
        GRAPH_OUTPUT(g, graph_rows(g, graph_conv(g, x, &r->field)), "field",
                     1, h / 4, w / 4, NARROW_REFINER_FIELD);
        d = GRAPH_NODE(g, "Clip", d, graph_real(g, -NARROW_REFINER_MAX),
                       graph_real(g, NARROW_REFINER_MAX));
        for (size_t c = 3; c < NARROW_END_COLORS; c *= 2)
            d = graph_concat(g, d, d);   /* the same for all of a place */
    }
    x = GRAPH_NODE(g, "Add", graph_slice(g, features, 0, 3),
                   graph_to_space(g, d, 4));
    GRAPH_OUTPUT(g, graph_rows(g, x), "rgb", 1, h, w, 3);
}
