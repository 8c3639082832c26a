/* The last step of every decoder: raw numbers to colour, opacity, scale,
 * rotation and position, and back. */
#include "lib/net/gaussian_head.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/nn/math.h"

#define TINY 1e-12

size_t gaussian_head_width(const struct gaussian_head *h)
{
    static const size_t extra[] = { 0, 1, 3 };

    return h->colors + (h->colors_only ? 0 : 8 + extra[h->position]);
}

/* Whether colour channel c of point n goes through the sigmoid. */
static bool gaussian_color_sigmoid(const struct gaussian_head *h, size_t n,
                                   size_t c, size_t image_w)
{
    return h->quirk_columns ? n % image_w < 3 : c < 3;
}

/* Length of a quaternion, never 0. */
static float gaussian_quat_norm(const float *q)
{
    double n = sqrt((double)q[0] * (double)q[0] + (double)q[1] * (double)q[1] +
                    (double)q[2] * (double)q[2] + (double)q[3] * (double)q[3]);

    return (float)fmax(n, TINY);
}

/* What goes through a sigmoid, of one Gaussian: side by side, so that it is
 * computed at once. */
enum { COLOR, OPACITY = COLOR + 3, SCALE, DEPTH = SCALE + 3, SIGMOIDS };

/* y <- the sigmoids of these numbers of raw, colours with their prior; of others 0.5
 * where only colours are wanted. */
static void gaussian_sigmoids(float y[SIGMOIDS], const float *raw,
                              const float *logit,
                              const struct gaussian_head *h)
{
    const bool all = !h->colors_only;
    const size_t C = h->colors;

    for (size_t c = 0; c < 3; c++) {
        y[COLOR + c] = (c < C ? raw[c] : 0) + (logit ? logit[c] : 0);
        y[SCALE + c] = all ? raw[C + 1 + c] : 0;
    }
    y[OPACITY] = all ? raw[C] : 0;
    y[DEPTH] = all && h->position == GAUSSIAN_POSITION_DEPTH ? raw[C + 8] : 0;
#pragma omp simd
    for (size_t i = 0; i < SIGMOIDS; i++)
        y[i] = math_sigmoid(y[i]);
}

/* Colours of one Gaussian, some of which are sigmoids. */
static void gaussian_colors(float *color, const float *raw, const float *logit,
                            const float y[SIGMOIDS],
                            const struct gaussian_head *h, size_t n,
                            size_t image_w)
{
    const size_t kept = h->kept ? h->kept : h->colors;

    if (!h->quirk_columns) {
        for (size_t c = 0; c < 3 && c < kept; c++)
            color[c] = y[COLOR + c];
        for (size_t c = 3; c < kept; c++)
            color[c] = raw[c];
        return;
    }
    for (size_t c = 0; c < kept; c++) {
        float x = raw[c] + (logit && c < 3 ? logit[c] : 0);

        color[c] = gaussian_color_sigmoid(h, n, c, image_w) ? math_sigmoid(x)
                                                            : x;
    }
}

/* Gaussian `at` of all. */
PARALLEL(gaussian_forward, at, struct gaussian_out *, o, const float *, raws,
         const float *, logits, const struct gaussian_head *, h,
         size_t, stride, size_t, N, size_t, image_w)
{
    const float *raw = raws + at * stride;
    const float *logit = logits ? logits + 3 * at : NULL;
    const size_t C = h->colors, kept = h->kept ? h->kept : C;
    float y[SIGMOIDS];

    gaussian_sigmoids(y, raw, logit, h);
    gaussian_colors(o->color + at * kept, raw, logit, y, h, at % N, image_w);
    if (h->colors_only)
        return;
    o->opacity[at] = y[OPACITY];
    for (size_t i = 0; i < 3; i++)
        o->scale[3 * at + i] = GAUSSIAN_SCALE_MAX * y[SCALE + i];
    float unit = h->quirk_rotation ? 1
                                   : 1 / gaussian_quat_norm(raw + C + 4);
    for (size_t i = 0; i < 4; i++)
        o->quat[4 * at + i] = raw[C + 4 + i] * unit;
    if (h->position == GAUSSIAN_POSITION_DEPTH)
        o->position[at] = y[DEPTH];
    else if (h->position == GAUSSIAN_POSITION_OFFSET)
        for (size_t i = 0; i < 3; i++)
            o->position[3 * at + i] = raw[C + 8 + i];
}

/* Length over the points of item b of rotation component i. */
static double gaussian_points_norm(const float *raw, size_t N, size_t stride,
                                   size_t i)
{
    double sum = 0;

    for (size_t n = 0; n < N; n++)
        sum += (double)raw[n * stride + i] * (double)raw[n * stride + i];
    return fmax(sqrt(sum), TINY);
}

void gaussian_head_forward(struct gaussian_out *out, const float *raw,
                           const float *rgb_logit,
                           const struct gaussian_head *h, size_t B, size_t N,
                           size_t stride, size_t image_w)
{
    parallel_each(gaussian_forward, B * N, 1, out, raw, rgb_logit, h, stride, N,
                  image_w);
    if (!h->quirk_rotation || h->colors_only)
        return;
    for (size_t b = 0; b < B; b++)
        for (size_t i = 0; i < 4; i++) {
            double n = gaussian_points_norm(raw + b * N * stride, N, stride,
                                            h->colors + 4 + i);

            for (size_t k = b * N; k < (b + 1) * N; k++)
                out->quat[4 * k + i] = (float)((double)out->quat[4 * k + i] /
                                               n);
        }
}

/* Derivative of the sigmoid where it is y. */
static float gaussian_sigmoid_slope(float y)
{
    return y * (1 - y);
}

/* In the forward pass this was: quat = raw / |raw|. */
static void gaussian_quat_backward(float *draw, const float *dq,
                                   const float *raw)
{
    float n = gaussian_quat_norm(raw);
    double along = 0;

    for (int i = 0; i < 4; i++)
        along += (double)dq[i] * (double)raw[i];
    if ((double)n <= TINY)
        along = 0;
    for (int i = 0; i < 4; i++)
        draw[i] = (float)(((double)dq[i] - along * (double)raw[i] /
                           ((double)n * (double)n)) / (double)n);
}

/* In the forward pass: colours, some of them sigmoids; g (C) or NULL is their
 * gradient. */
static void gaussian_colors_backward(float *draw, const float *g,
                                     const float *raw, const float *logit,
                                     const float y[SIGMOIDS],
                                     const struct gaussian_head *h, size_t n,
                                     size_t image_w)
{
    if (!g) {
        memset(draw, 0, h->colors * sizeof *draw);
        return;
    }
    if (!h->quirk_columns) {
        for (size_t c = 0; c < 3 && c < h->colors; c++)
            draw[c] = g[c] * gaussian_sigmoid_slope(y[COLOR + c]);
        for (size_t c = 3; c < h->colors; c++)
            draw[c] = g[c];
        return;
    }
    for (size_t c = 0; c < h->colors; c++) {
        float x = raw[c] + (logit && c < 3 ? logit[c] : 0);

        draw[c] = gaussian_color_sigmoid(h, n, c, image_w)
                      ? g[c] * gaussian_sigmoid_slope(math_sigmoid(x)) : g[c];
    }
}

/* draws, and dlogits unless NULL, of one Gaussian. */
PARALLEL(gaussian_backward, at, float *, draws, float *, dlogits,
         const struct gaussian_out *, d, const float *, raws,
         const float *, logits, const struct gaussian_head *, h,
         size_t, stride, size_t, N, size_t, image_w)
{
    const float *raw = raws + at * stride;
    const float *logit = logits ? logits + 3 * at : NULL;
    float *draw = draws + at * stride, y[SIGMOIDS];
    size_t C = h->colors;

    gaussian_sigmoids(y, raw, logit, h);
    gaussian_colors_backward(draw, d->color ? d->color + at * C : NULL, raw,
                             logit, y, h, at % N, image_w);
    for (size_t c = 0; dlogits && c < 3 && c < C; c++)
        dlogits[3 * at + c] = draw[c];
    if (h->colors_only)
        return;
    draw[C] = d->opacity ? d->opacity[at] * gaussian_sigmoid_slope(y[OPACITY])
                         : 0;
    for (size_t i = 0; i < 3; i++)
        draw[C + 1 + i] = d->scale ? GAUSSIAN_SCALE_MAX * d->scale[3 * at + i] *
                                         gaussian_sigmoid_slope(y[SCALE + i])
                                   : 0;
    for (size_t i = 0; i < 4; i++)
        draw[C + 4 + i] = 0;
    if (d->quat && !h->quirk_rotation)
        gaussian_quat_backward(draw + C + 4, d->quat + 4 * at, raw + C + 4);
    if (h->position == GAUSSIAN_POSITION_DEPTH)
        draw[C + 8] = d->position
                    ? d->position[at] * gaussian_sigmoid_slope(y[DEPTH])
                    : 0;
    else if (h->position == GAUSSIAN_POSITION_OFFSET)
        for (size_t i = 0; i < 3; i++)
            draw[C + 8 + i] = d->position ? d->position[3 * at + i] : 0;
}

/* In the forward pass: quat[n] = raw[n] / sqrt(sum_n raw[n]^2), each i. */
static void gaussian_points_backward(float *draw, const float *dq,
                                     const float *raw, size_t N, size_t stride,
                                     size_t at)
{
    for (size_t i = 0; i < 4; i++) {
        double n = gaussian_points_norm(raw, N, stride, at + i), along = 0;

        for (size_t k = 0; k < N; k++)
            along += (double)dq[4 * k + i] * (double)raw[k * stride + at + i];
        if (n <= TINY)
            along = 0;
        for (size_t k = 0; k < N; k++)
            draw[k * stride + at + i] =
                (float)((double)dq[4 * k + i] / n -
                        along * (double)raw[k * stride + at + i] /
                            (n * n * n));
    }
}

void gaussian_head_backward(float *draw, float *drgb_logit,
                            const struct gaussian_out *dout, const float *raw,
                            const float *rgb_logit,
                            const struct gaussian_head *h, size_t B, size_t N,
                            size_t stride, size_t image_w)
{
    parallel_each(gaussian_backward, B * N, 1, draw, drgb_logit, dout, raw,
                  rgb_logit, h, stride, N, image_w);
    if (h->quirk_rotation && !h->colors_only && dout->quat)
        for (size_t b = 0; b < B; b++)
            gaussian_points_backward(draw + b * N * stride,
                                     dout->quat + 4 * b * N,
                                     raw + b * N * stride, N, stride,
                                     h->colors + 4);
}

/* ---- as a graph ---------------------------------------------------------- */

void gaussian_head_graph(struct graph *g, int raw, int rgb_logit, size_t N,
                         const struct gaussian_head *h)
{
    const size_t C = h->colors, all = gaussian_head_width(h);
    int rgb = GRAPH_NODE(g, "Add", graph_slice(g, raw, 0, 3), rgb_logit);

    if (h->quirk_columns || h->quirk_rotation || C < 4)
        graph_fail(g, EX_CONFIG, "a decoder with the public code's slips has "
                   "no ONNX form here");
    GRAPH_OUTPUT(g, graph_concat(g, graph_act(g, rgb, ACT_SIGMOID),
                                 graph_slice(g, raw, 3, C)),
                 "color", N, C);
    if (h->colors_only)
        return;
    int scale = graph_act(g, graph_slice(g, raw, C + 1, C + 4),
                          ACT_SIGMOID);
    int quat = graph_slice(g, raw, C + 4, C + 8);
    int last = graph_slice(g, raw, C + 8, all);

    GRAPH_OUTPUT(g, graph_act(g, graph_slice(g, raw, C, C + 1),
                              ACT_SIGMOID), "opacity", N, 1);
    GRAPH_OUTPUT(g, GRAPH_NODE(g, "Mul", scale,
                               graph_real(g, GAUSSIAN_SCALE_MAX)),
                 "scale", N, 3);
    int length = GRAPH_NODE(g, "ReduceL2", quat);
    graph_set_ints(g, "axes", (int64_t[]){1}, 1);
    length = GRAPH_NODE(g, "Max", length, graph_real(g, (float)TINY));
    GRAPH_OUTPUT(g, GRAPH_NODE(g, "Div", quat, length), "quat", N, 4);
    if (h->position == GAUSSIAN_POSITION_NONE)
        return;
    if (h->position == GAUSSIAN_POSITION_DEPTH)
        last = graph_act(g, last, ACT_SIGMOID);
    GRAPH_OUTPUT(g, last, "position", N, all - C - 8);
}
