/* Residual blocks that change the scale, and the conditions on their maps
 * (GAGAvatar's StyleUNet). */
#include "lib/net/style_blocks.h"

#include <string.h>

#include "lib/nn/image.h"


void style_lrelu_conv(struct conv *c, struct params *ps,
                      const char *name, size_t in, size_t out,
                      size_t kernel)

{
    conv_init(c, ps, name, in, out, kernel, 1, true);
    c->act = ACT_LRELU;
    ps->tensor[c->weight].gain = ACT_LRELU_GAIN;
}

void style_res_init(struct style_res *r, struct params *ps,
                    const char *at, size_t in, size_t out, bool up)

{
    char name[120];

    r->up = up;
    style_lrelu_conv(&r->conv1, ps, nn_name(name, "%s.conv1", at), in, in, 3);
    style_lrelu_conv(&r->conv2, ps, nn_name(name, "%s.conv2", at), in, out, 3);
    conv_init(&r->skip, ps, nn_name(name, "%s.skip", at), in, out, 1, 1,
              false);
}

void style_condition_init(struct style_condition *c, struct params *ps,
                          const char *at, size_t in, size_t out,
                          float bias)

{
    char name[120];

    style_lrelu_conv(&c->a, ps, nn_name(name, "%s.0", at), in, in, 3);
    conv_init(&c->b, ps, nn_name(name, "%s.2", at), in, out, 3, 1, true);
    ps->tensor[c->b.weight].gain = 0.3f;
    ps->tensor[c->b.bias].init = PARAM_CONSTANT;
    ps->tensor[c->b.bias].gain = bias;
}

void style_res_plan(struct style_res *r, struct nn_plan *p, size_t B,
                    size_t side)

{
    size_t in = r->conv1.in, out = r->conv2.out;
    size_t to = r->up ? 2 * side : side / 2;
    bool train = nn_plan_backward(p);

    r->h = r->w = side;
    r->h1 = nn_plan_map(p, B * side * side * in);
    conv_plan(&r->conv1, p, B, side, side);
    r->h1s = nn_plan_map(p, B * to * to * in);
    rescale_plan(&r->move_h, p, RESCALE_BILINEAR, B, side, side, to, to, in);
    nn_plan_recycle(p, r->h1);
    r->out = nn_plan_map(p, B * to * to * out);
    r->h2 = train ? nn_plan_map(p, B * to * to * out) : r->out;
    conv_plan(&r->conv2, p, B, to, to);
    nn_plan_recycle(p, r->h1s);
    if (r->up) {                  /* the 1x1 is cheaper before enlarging */
        r->sx = nn_plan_map(p, B * side * side * out);
        r->xs = nn_plan_map(p, B * to * to * out);
        conv_plan(&r->skip, p, B, side, side);
        rescale_plan(&r->move_x, p, RESCALE_BILINEAR, B, side, side, to, to,
                     out);
        nn_plan_recycle(p, r->sx);
    } else {
        r->xs = nn_plan_map(p, B * to * to * in);
        r->sx = nn_plan_map(p, B * to * to * out);
        rescale_plan(&r->move_x, p, RESCALE_BILINEAR, B, side, side, to, to,
                     in);
        conv_plan(&r->skip, p, B, to, to);
        nn_plan_recycle(p, r->sx);
    }
    nn_plan_recycle(p, r->xs);
}

void style_condition_plan(struct style_condition *c, struct nn_plan *p,
                          size_t B, size_t side)

{
    c->h = nn_plan_map(p, B * side * side * c->a.out);
    conv_plan(&c->a, p, B, side, side);
    c->out = nn_plan_map(p, B * side * side * c->b.out);
    conv_plan(&c->b, p, B, side, side);
    nn_plan_recycle(p, c->h);
}

size_t style_res_size(const struct style_res *r)

{
    return r->conv2.batch * r->conv2.oh * r->conv2.ow * r->conv2.out;
}

void style_res_forward(const float *x, struct style_res *r)

{
    conv_forward(r->h1, x, &r->conv1);
    rescale_forward(r->h1s, r->h1, &r->move_h);
    conv_forward(r->h2, r->h1s, &r->conv2);
    if (r->up) {
        conv_forward(r->sx, x, &r->skip);
        rescale_forward(r->xs, r->sx, &r->move_x);
    } else {
        rescale_forward(r->xs, x, &r->move_x);
        conv_forward(r->sx, r->xs, &r->skip);
    }
    if (r->out != r->h2)
        memcpy(r->out, r->h2, style_res_size(r) * sizeof *r->out);
    image_add(r->out, r->up ? r->xs : r->sx, style_res_size(r));
}

void style_res_backward(float *dx, float *dout, const float *x,
                        float *a, float *b, struct style_res *r)

{
    size_t n = r->conv1.batch * r->h * r->w * r->conv1.in;

    if (r->up) {
        rescale_backward(a, dout, &r->move_x);
        conv_backward(dx, a, NULL, x, &r->skip);
    } else {
        conv_backward(a, dout, NULL, r->xs, &r->skip);
        rescale_backward(dx, a, &r->move_x);
    }
    conv_backward(a, dout, r->h2, r->h1s, &r->conv2);
    rescale_backward(b, a, &r->move_h);
    conv_backward(a, b, r->h1, x, &r->conv1);
    image_add(dx, a, n);
}

void style_condition_forward(const float *f, struct style_condition *c)

{
    conv_forward(c->h, f, &c->a);
    conv_forward(c->out, c->h, &c->b);
}

void style_condition_backward(float *df, float *dout, const float *f,
                              float *a, float *b,
                              struct style_condition *c)

{
    conv_backward(a, dout, NULL, c->h, &c->b);
    conv_backward(b, a, c->h, f, &c->a);
    image_add(df, b, c->a.batch * c->a.h * c->a.w * c->a.in);
}
