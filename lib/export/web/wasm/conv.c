/* In place of oneDNN (lib/nn/engine.h, lib/nn/conv_impl.h), which no browser
 * has: a layer that would be its direct convolution is a product of unfolded
 * windows.  Nothing learns in a page, so that what gradients need is missing. */
#include <assert.h>

#include "lib/nn/conv_impl.h"

dnnl_engine_t nn_engine(void)
{
    static char any;

    return (dnnl_engine_t)&any;
}

bool nn_has(dnnl_cpu_isa_t isa)
{
    (void)isa;
    return false;
}

bool nn_type_native(enum nn_type type)
{
    return type == NN_F32 || type == NN_FAST;
}

void nn_call_release(struct nn_call *c)
{
    assert(!c->prim);           /* there never is one */
    (void)c;
}

void conv_onednn_plan_forward(struct conv *c, const struct conv_shape *s)
{
    im2col_plan(c, s);
}

void conv_onednn_reorder(struct nn_call *call, void *to, const void *from,
                         struct conv *c)
{
    (void)call;
    (void)to;
    im2col_update(c, from);
}

void conv_onednn_forward(void *out, const void *src, const float *bias,
                         const float *scale, struct conv *c)
{
    (void)bias;
    (void)scale;
    im2col_forward(out, src, c);
}
