/* 1x1 convolutions in bfloat16: planning, and the split of the work into bands
 * of rows and, where rows are summed, into a fixed number of parts. */
#include "lib/nn/pointwise.h"

#include "lib/base/parallel.h"
#include "lib/nn/conv_impl.h"
#include "lib/nn/kernels.h"
#include "lib/nn/pairs_size.h"

bool pointwise_wanted(const struct conv *c)
{
    return nn_plan_backward(c->plan) && c->plan->opt.type == NN_BF16 &&
           cpu_level() == CPU_AVX512 && c->kernel == 1 && c->stride == 1 &&
           c->in % 2 == 0 && c->out % 2 == 0 && c->in_data == c->in &&
           c->bias == NN_NONE && c->gamma == NN_NONE && !c->shuffle &&
           !c->add && c->act == ACT_NONE && !c->half_in && !c->half_out;
}

/* n up to whole panels. */
static size_t pointwise_panels(size_t n)
{
    return (n + PAIRS_PANEL - 1) / PAIRS_PANEL * PAIRS_PANEL;
}

void pointwise_plan(struct conv *c, const struct conv_shape *s)
{
    struct pointwise *t = &c->impl->pointwise;
    struct nn_plan *p = c->plan;
    size_t in = c->in, out = c->out, max = in > out ? in : out;
    size_t wide = pointwise_panels(in), R = POINTWISE_PAIRS;

    (void)s;
    t->plan = p;
    t->rows = c->batch * c->h * c->w;
    t->in = in;
    t->out = out;
    t->band = 8 * PAIRS_ROWS;
    t->forward = nn_plan_bytes(p, in / 2 * pointwise_panels(out) * 4);
    t->back = nn_plan_bytes(p, out / 2 * wide * 4);
    t->dw = nn_plan_floats(p, NN_PARTS * out * wide);
    t->half_size = (PAIRS_ROWS * max * 2 + 63) / 64 * 64;
    t->pairs_size = ((pointwise_panels(out) + wide) * R + PAIRS_ROWS) * 4;
    t->pairs_size = (t->pairs_size + 63) / 64 * 64;
    nn_plan_scratch(p, t->half_size * (size_t)parallel_width());
    nn_plan_scratch(p, t->pairs_size * NN_PARTS);
}

void pointwise_update(struct conv *c, const float *w)
{
    const struct nn_kernels *k = nn_kernels();
    struct pointwise *t = &c->impl->pointwise;

    k->pointwise_pack(t->forward, w, 1, t->in, t->in, t->out);
    k->pointwise_pack(t->back, w, t->in, 1, t->out, t->in);
}

/* One chunk. */
PARALLEL(pointwise_multiply_part, part, const struct pointwise *, t, float *, C,
         const float *, A, const uint32_t *, packed, size_t, N, size_t, K)
{
    size_t r = part * t->band;
    size_t m = t->rows - r < t->band ? t->rows - r : t->band;
    char *half = t->plan->scratch + parallel_slot() * t->half_size;

    nn_kernels()->pointwise_rows(C + r * N, A + r * K, (uint32_t *)(void *)half,
                                 packed, m, N, K);
}

/* C (rows,N) = A (rows,K) times packed weights. */
static void pointwise_multiply(float *C, const float *A,
                               const uint32_t *packed, size_t N, size_t K,
                               const struct pointwise *t)
{
    parallel_each(pointwise_multiply_part, (t->rows + t->band - 1) / t->band, 1,
                  t, C, A, packed, N, K);
}

void pointwise_forward(float *out, const float *in, struct conv *c)
{
    const struct pointwise *t = &c->impl->pointwise;

    pointwise_multiply(out, in, t->forward, t->out, t->in, t);
}

void pointwise_backward_data(float *din, const float *dout,
                             struct pointwise *t)
{
    pointwise_multiply(din, dout, t->back, t->in, t->out, t);
}

PARALLEL(pointwise_backward_weights_part, i, struct pointwise *, t,
         const float *, dout, const float *, in, size_t, size)
{
    size_t r = i * t->rows / NN_PARTS;
    size_t m = (i + 1) * t->rows / NN_PARTS - r;
    char *pairs = t->plan->scratch + i * t->pairs_size;

    nn_kernels()->pointwise_weights(t->dw + i * size, dout + r * t->out,
                                    in + r * t->in, (uint32_t *)(void *)pairs,
                                    m, t->out, t->in);
}

void pointwise_backward_weights(float *g, const float *dout, const float *in,
                                struct pointwise *t)
{
    size_t wide = pointwise_panels(t->in), size = t->out * wide;

    parallel_each(pointwise_backward_weights_part, NN_PARTS, 1, t, dout, in,
                  size);
    for (size_t o = 0; o < t->out; o++)
        for (size_t i = 0; i < NN_PARTS; i++)
            nn_kernels()->add(g + o * t->in, t->dw + i * size + o * wide,
                              t->in);
}
