/* LAM's networks at a small size against its definition in plain double: the
 * picture's and the positions' resizing, a transformer with registers, joint
 * attention, heads.  With arguments OUT and a configuration it only writes a
 * checkpoint of formula weights in the public names, for the pipe tests. */
#include "lib/net/lam.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/arena.h"
#include "lib/base/random.h"
#include "tests/check.h"

#define METRE 5             /* units of a metre */

static const struct avatar_config small = {
    .system = SYSTEM_LAM, .size = 48, .plane = 8, .channels = 3, .feature = 24,
    .backbone = {.type = BACKBONE_DINOV2, .embed = 32, .depth = 24, .heads = 2,
                 .patch = 7, .image = 42, .registers = 3},
    .dynamic_width = 48, .dynamic_hidden = 20, .transformer_layers = 3,
    .transformer_heads = 3
};

/* Seeded numbers, and a wave over each tensor, so that none is all ones or
 * zeros. */
static void lam_fill(struct params *ps)
{
    params_randomise(ps, 1);
    for (size_t i = 0; i < ps->count; i++) {
        float *w = param_w(ps, i);

        for (size_t k = 0; k < ps->tensor[i].count; k++)
            w[k] += 0.05f * (float)sin(0.7 * (double)k + (double)i);
    }
}

/* ---- the definition ------------------------------------------------------ */

/* What the definition is computed in, until the test ends. */
static struct arena memory;

static double *grab(size_t n)
{
    double *x = arena_take(&memory, n, sizeof *x);

    if (!x)
        exit(1);
    return x;
}

/* A tensor by its name in the checkpoint. */
static const float *tensor(const struct params *ps, const char *at,
                           const char *name)
{
    char text[160];

    snprintf(text, sizeof text, "%s%s", at, name);
    const size_t i = params_find(ps, text);
    REQUIRE(i != SIZE_MAX, "no tensor %s", text);
    return param_w(ps, i);
}

/* rows of `in` numbers to `out`, by "<at><name>.weight" and ".bias". */
static double *linear(const struct params *ps, const char *at,
                      const char *name, const double *x, size_t rows,
                      size_t in, size_t out)
{
    char text[160];
    double *y = grab(rows * out);

    snprintf(text, sizeof text, "%s%s", at, name);
    const float *w = tensor(ps, text, ".weight"), *b = tensor(ps, text, ".bias");
    for (size_t r = 0; r < rows; r++)
        for (size_t o = 0; o < out; o++) {
            y[r * out + o] = b[o];
            for (size_t i = 0; i < in; i++)
                y[r * out + o] += (double)w[o * in + i] * x[r * in + i];
        }
    return y;
}

/* Layer norm of rows; name NULL: without weight and bias. */
static double *norm(const struct params *ps, const char *at, const char *name,
                    const double *x, size_t rows, size_t n, double eps)
{
    double *y = grab(rows * n);
    char text[160];

    snprintf(text, sizeof text, "%s%s", at, name ? name : "");
    const float *w = name ? tensor(ps, text, ".weight") : NULL;
    const float *b = name ? tensor(ps, text, ".bias") : NULL;
    for (size_t r = 0; r < rows; r++) {
        const double *in = x + r * n;
        double mean = 0, var = 0;

        for (size_t i = 0; i < n; i++)
            mean += in[i] / (double)n;
        for (size_t i = 0; i < n; i++)
            var += (in[i] - mean) * (in[i] - mean) / (double)n;
        for (size_t i = 0; i < n; i++) {
            const double z = (in[i] - mean) / sqrt(var + eps);

            y[r * n + i] = w ? z * w[i] + b[i] : z;
        }
    }
    return y;
}

/* Attention of T rows of q, k and v (T,E) in heads. */
static double *attend(const double *q, const double *k, const double *v,
                      size_t T, size_t E, size_t heads)
{
    const size_t d = E / heads;
    double *out = grab(T * E), *p = grab(T);

    for (size_t h = 0; h < heads; h++)
        for (size_t i = 0; i < T; i++) {
            double most = -1e300, sum = 0;

            for (size_t j = 0; j < T; j++) {
                p[j] = 0;
                for (size_t c = h * d; c < (h + 1) * d; c++)
                    p[j] += q[i * E + c] * k[j * E + c] / sqrt((double)d);
                most = fmax(most, p[j]);
            }
            for (size_t j = 0; j < T; j++)
                sum += p[j] = exp(p[j] - most);
            for (size_t j = 0; j < T; j++)
                for (size_t c = h * d; c < (h + 1) * d; c++)
                    out[i * E + c] += p[j] / sum * v[j * E + c];
        }
    return out;
}

/* One axis' weight of input i of n for output o of m: the share of o's extent,
 * or the wide cubic, which is not yet normalised. */
static double axis_weight(bool cubic, size_t i, size_t n, size_t o, size_t m)
{
    const double s = (double)n / (double)m, from = s * (double)o;

    if (!cubic)
        return fmax(0, fmin((double)i + 1, from + s) -
                           fmax((double)i, from)) / s;
    const double t = fabs((double)i + 0.5 - from - 0.5 * s) / s;

    return t < 1 ? 1.5 * t * t * t - 2.5 * t * t + 1
         : t < 2 ? -0.5 * t * t * t + 2.5 * t * t - 4 * t + 2 : 0;
}

/* (n,n,C) to (m,m,C). */
static double *resize(const float *x, size_t n, size_t m, size_t C, bool cubic)
{
    double *y = grab(m * m * C);

    for (size_t o = 0; o < m * m; o++) {
        double total = 0;

        for (size_t i = 0; i < n * n; i++) {
            const double w = axis_weight(cubic, i / n, n, o / m, m) *
                             axis_weight(cubic, i % n, n, o % m, m);

            total += w;
            for (size_t c = 0; c < C; c++)
                y[o * C + c] += w * x[i * C + c];
        }
        for (size_t c = 0; c < C; c++)
            y[o * C + c] /= total;
    }
    return y;
}

/* Class token, registers, and patches of picture (side,side,3) with their
 * places. */
static double *dino_tokens(const struct params *ps, const double *picture,
                           const struct backbone_config *b)
{
    const char *at = "encoder.model.";
    const size_t side = b->image / b->patch, P = b->patch, E = b->embed;
    const size_t R = b->registers;
    const float *w = tensor(ps, at, "patch_embed.proj.weight");
    const float *bias = tensor(ps, at, "patch_embed.proj.bias");
    const float *place = tensor(ps, at, "pos_embed");
    double *resized = resize(place + E, 37, side, E, true);
    double *x = grab((1 + R + side * side) * E);

    for (size_t e = 0; e < E; e++) {
        x[e] = (double)tensor(ps, at, "cls_token")[e] + place[e];
        for (size_t r = 0; r < R; r++)
            x[(1 + r) * E + e] = tensor(ps, at, "register_tokens")[r * E + e];
        for (size_t i = 0; i < side * side; i++) {
            double sum = bias[e] + resized[i * E + e];

            for (size_t c = 0; c < 3; c++)
                for (size_t k = 0; k < P * P; k++)
                    sum += w[(e * 3 + c) * P * P + k] *
                           picture[((i / side * P + k / P) * b->image +
                                    i % side * P + k % P) * 3 + c];
            x[(1 + R + i) * E + e] = sum;
        }
    }
    return x;
}

/* Block i on x (T,E), in place. */
static void dino_block(const struct params *ps, double *x, size_t T, size_t E,
                       size_t heads, size_t i)
{
    char at[80];
    double *part[3];

    snprintf(at, sizeof at, "encoder.model.blocks.%zu.", i);
    double *qkv = linear(ps, at, "attn.qkv", norm(ps, at, "norm1", x, T, E,
                                                  1e-6), T, E, 3 * E);
    for (size_t k = 0; k < 3; k++) {
        part[k] = grab(T * E);
        for (size_t t = 0; t < T; t++)
            memcpy(part[k] + t * E, qkv + (3 * t + k) * E, E * sizeof *qkv);
    }
    double *y = linear(ps, at, "attn.proj",
                       attend(part[0], part[1], part[2], T, E, heads), T, E, E);
    for (size_t k = 0; k < T * E; k++)
        x[k] += y[k] * tensor(ps, at, "ls1.gamma")[k % E];
    y = linear(ps, at, "mlp.fc1", norm(ps, at, "norm2", x, T, E, 1e-6), T, E,
               4 * E);
    for (size_t k = 0; k < T * 4 * E; k++)
        y[k] *= 0.5 * (1 + erf(y[k] / sqrt(2)));
    y = linear(ps, at, "mlp.fc2", y, T, 4 * E, E);
    for (size_t k = 0; k < T * E; k++)
        x[k] += y[k] * tensor(ps, at, "ls2.gamma")[k % E];
}

/* The picture's features (M,feature): of four blocks of 24. */
static double *lam_features(const struct params *ps, const float *rgb,
                            const struct avatar_config *c)
{
    const struct backbone_config *b = &c->backbone;
    const size_t M = (b->image / b->patch) * (b->image / b->patch);
    const size_t E = b->embed, T = 1 + b->registers + M;
    double *x = dino_tokens(ps, resize(rgb, c->size, b->image, 3, false), b);
    static const size_t given[4] = {4, 11, 17, 23};
    double *joined = grab(M * 4 * E);
    size_t k = 0;

    for (size_t i = 0; i < b->depth; i++) {
        char name[32];

        dino_block(ps, x, T, E, b->heads, i);
        if (i != given[k])
            continue;
        snprintf(name, sizeof name, "projects.%zu", k);
        double *y = linear(ps, "encoder.fusion_head.", name,
                           norm(ps, "encoder.model.", "norm", x, T, E, 1e-6) +
                               (T - M) * E, M, E, E);
        for (size_t m = 0; m < M; m++)
            memcpy(joined + (4 * m + k) * E, y + m * E, E * sizeof *y);
        k++;
    }
    return linear(ps, "encoder.fusion_head.", "output_conv", joined, M, 4 * E,
                  c->feature);
}

/* A head's part of rows over its root mean square, times weight. */
static void unit(double *x, const float *w, size_t rows, size_t D,
                 size_t heads)
{
    const size_t d = D / heads;

    for (size_t i = 0; i < rows * heads; i++) {
        double sum = 0;

        for (size_t k = 0; k < d; k++)
            sum += x[i * d + k] * x[i * d + k] / (double)d;
        for (size_t k = 0; k < d; k++)
            x[i * d + k] *= w[k] / sqrt(sum + 1e-6);
    }
}

/* x += feed-forward of its plain norm. */
static void feed(const struct params *ps, const char *at, const char *name,
                 double *x, size_t rows, size_t D)
{
    char one[32], two[32];

    snprintf(one, sizeof one, "%s.net.0.proj", name);
    snprintf(two, sizeof two, "%s.net.2", name);
    double *y = linear(ps, at, one, norm(ps, at, NULL, x, rows, D, 1e-6), rows,
                       D, 4 * D);
    for (size_t k = 0; k < rows * 4 * D; k++)
        y[k] *= 0.5 * (1 + tanh(sqrt(2 / M_PI) *
                                (y[k] + 0.044715 * y[k] * y[k] * y[k])));
    y = linear(ps, at, two, y, rows, 4 * D, D);
    for (size_t k = 0; k < rows * D; k++)
        x[k] += y[k];
}

/* Block i on points x (N,D) and the picture's rows y (M,D), in place. */
static void joint_block(const struct params *ps, double *x, double *y,
                        size_t N, size_t M, const struct avatar_config *c,
                        size_t i)
{
    static const char *const in[3][2] = {{"to_q", "add_q_proj"},
                                         {"to_k", "add_k_proj"},
                                         {"to_v", "add_v_proj"}};
    static const char *const scale[2][2] = {{"norm_q", "norm_added_q"},
                                            {"norm_k", "norm_added_k"}};
    const size_t D = c->dynamic_width, heads = c->transformer_heads;
    char at[80], text[120];
    double *part[3];

    snprintf(at, sizeof at, "transformer.layers.%zu.", i);
    double *n[2] = {norm(ps, at, "norm1", x, N, D, 1e-5),
                    norm(ps, at, "norm1_context", y, M, D, 1e-5)};
    for (int k = 0; k < 3; k++) {
        part[k] = grab((N + M) * D);
        for (int s = 0; s < 2; s++) {
            const size_t rows = s ? M : N;

            snprintf(text, sizeof text, "attn.%s", in[k][s]);
            double *z = linear(ps, at, text, n[s], rows, D, D);
            if (k < 2) {
                snprintf(text, sizeof text, "attn.%s.weight", scale[k][s]);
                unit(z, tensor(ps, at, text), rows, D, heads);
            }
            memcpy(part[k] + (s ? N * D : 0), z, rows * D * sizeof *z);
        }
    }
    double *out = attend(part[0], part[1], part[2], N + M, D, heads);
    double *z = linear(ps, at, "attn.to_out.0", out, N, D, D);
    for (size_t k = 0; k < N * D; k++)
        x[k] += z[k];
    feed(ps, at, "ff", x, N, D);
    if (i + 1 == c->transformer_layers)
        return;
    z = linear(ps, at, "attn.to_add_out", out + N * D, M, D, D);
    for (size_t k = 0; k < M * D; k++)
        y[k] += z[k];
    feed(ps, at, "ff_context", y, M, D);
}

/* Points to rows (N,D) of the decoder. */
static double *lam_rows(const struct params *ps, const float *rgb,
                        const float *points, size_t N,
                        const struct avatar_config *c)
{
    const size_t side = c->backbone.image / c->backbone.patch;
    const size_t M = side * side, D = c->dynamic_width;
    double *code = grab(N * 51), *features = lam_features(ps, rgb, c);

    for (size_t i = 0; i < N; i++)
        for (size_t a = 0; a < 3; a++) {
            const double p = (double)points[3 * i + a] / METRE;

            for (size_t k = 0; k < 8; k++) {
                code[i * 51 + 8 * a + k] = sin(M_PI * pow(2, (double)k) * p);
                code[i * 51 + 24 + 8 * a + k] = cos(M_PI * pow(2, (double)k) *
                                                    p);
            }
            code[i * 51 + 48 + a] = p;
        }
    double *x = norm(ps, "pcl_embed.", "norm",
                     linear(ps, "pcl_embed.", "mlp", code, N, 51, D), N, D,
                     1e-5);
    double *y = linear(ps, "transformer.", "linear_cond_proj", features, M,
                       c->feature, D);
    for (size_t i = 0; i < c->transformer_layers; i++)
        joint_block(ps, x, y, N, M, c, i);
    x = norm(ps, "transformer.", "norm", x, N, D, 1e-6);
    for (size_t i = 0; i < 3; i++) {
        const size_t H = c->dynamic_hidden, to = i < 2 ? H : D;
        char name[16];

        snprintf(name, sizeof name, "layers.%zu", 2 * i);
        x = linear(ps, "renderer.mlp_net.", name, x, N, i ? H : D, to);
        for (size_t k = 0; i < 2 && k < N * to; k++)
            x[k] /= 1 + exp(-x[k]);
    }
    return x;
}

/* The greatest difference of n numbers, relative to the greatest of them. */
static double apart(const float *got, const double *want, size_t n)
{
    double worst = 0, most = 0;

    for (size_t k = 0; k < n; k++) {
        worst = fmax(worst, isfinite(got[k]) ? fabs(got[k] - want[k]) : 1e9);
        most = fmax(most, fabs(want[k]));
    }
    return worst / most;
}

/* All five heads of the definition against the set. */
static void check_heads(const struct params *ps, const struct lam *l,
                        const double *rows)
{
    static const char *const name[5] = {"shs", "scaling", "xyz", "opacity",
                                        "rotation"};
    static const size_t width[5] = {3, 3, 3, 1, 4};
    const float *const got[5] = {l->color, l->scale, l->offset, l->opacity,
                                 l->quat};
    size_t clamped = 0;

    for (int h = 0; h < 5; h++) {
        double *y = linear(ps, "renderer.gs_net.out_layers.", name[h], rows,
                           l->N, l->D, width[h]);

        for (size_t k = 0; k < l->N * width[h]; k++) {
            const double s = 1 / (1 + exp(-y[k]));

            clamped += h == 1 && exp(y[k]) > 0.01;
            y[k] = h == 1 ? METRE * fmin(exp(y[k]), 0.01)
                 : h == 2 ? METRE * (s - 0.5) * 0.2 : h == 4 ? y[k] : s;
        }
        for (size_t i = 0; h == 4 && i < l->N; i++) {
            double *q = y + 4 * i;
            const double n = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] +
                                  q[3] * q[3]);

            for (int k = 0; k < 4; k++)
                q[k] /= n;
        }
        check(name[h], apart(got[h], y, l->N * width[h]), 2e-5);
    }
    check_range("scales at their limit, of all", (double)clamped /
                (3 * (double)l->N), 0.01, 0.99);
}

/* Another picture gives other Gaussians: colours' mean difference. */
static double picture_matters(struct lam *l, float *rgb, const float *points)
{
    const size_t n = 3 * l->N;
    float *first = malloc((n + 1) * sizeof *first);
    double sum = 0;

    if (!first)
        exit(1);
    memcpy(first, l->color, n * sizeof *first);
    for (size_t i = 0; i < 3 * l->config.size * l->config.size; i++)
        rgb[i] = 1 - rgb[i];
    lam_bake(l, rgb, points, METRE);
    for (size_t i = 0; i < n; i++)
        sum += fabs(first[i] - l->color[i]) / (double)n;
    free(first);
    return sum;
}

static int lam_test(void)
{
    enum { N = 61 };
    struct params ps;
    struct lam l;
    struct error err = {0};
    struct random r;
    float *rgb = malloc(3 * small.size * small.size * sizeof *rgb);
    float points[3 * N];

    params_init(&ps);
    REQUIRE(rgb && !lam_init(&l, &ps, &small, &err) &&
            !params_allocate(&ps, &err), "%s", err.text);
    lam_fill(&ps);
    /* scales about their limit */
    float *bias = param_w(&ps, params_find(
        &ps, "renderer.gs_net.out_layers.scaling.bias"));
    for (int k = 0; k < 3; k++)
        bias[k] = -4.6f;
    REQUIRE(!lam_plan(&l, N, NN_F32, &err), "%s", err.text);
    random_init(&r, 7, "lam");
    for (size_t i = 0; i < 3 * small.size * small.size; i++)
        rgb[i] = (float)random_uniform(&r);
    for (int i = 0; i < 3 * N; i++)
        points[i] = (float)random_range(&r, -0.7, 0.7);
    lam_bake(&l, rgb, points, METRE);
    double *features = lam_features(&ps, rgb, &small);
    check("features", apart(l.features, features, l.M * small.feature), 2e-5);
    check_heads(&ps, &l, lam_rows(&ps, rgb, points, N, &small));
    check_range("another picture, colours", picture_matters(&l, rgb, points),
                1e-3, 1);
    lam_release(&l);
    params_release(&ps);
    arena_release(&memory);
    free(rgb);
    return check_status();
}

/* What cannot be planned is said. */
static void test_bad_sizes(void)
{
    struct avatar_config c = small;
    struct error err = {0};
    struct params ps;
    struct lam l;

    params_init(&ps);
    c.transformer_heads = 5;
    check_that("heads that do not divide", lam_init(&l, &ps, &c, &err) == -1 &&
               strstr(err.text, "transformer.heads 5"));
    params_release(&ps);
    params_init(&ps);
    c = small;
    c.channels = 32;
    check_that("32 channels", lam_init(&l, &ps, &c, &err) == -1 &&
               strstr(err.text, "32 channels"));
    params_release(&ps);
}

static void write_checkpoint(const char *out, const char *config)
{
    struct avatar_config c;
    struct params ps;
    struct lam l;
    struct error err = {0};

    params_init(&ps);
    REQUIRE(!avatar_config_load(&c, config, &err) &&
            !lam_init(&l, &ps, &c, &err) && !params_allocate(&ps, &err),
            "%s", err.text);
    lam_fill(&ps);
    REQUIRE(!params_save(&ps, out, NULL, &err), "%s", err.text);
    lam_release(&l);
    params_release(&ps);
}

int main(int argc, char **argv)
{
    if (argc == 1) {
        test_bad_sizes();
        return lam_test();
    }
    if (argc != 3) {
        printf("usage: lam_model [OUT CONFIG]\n");
        return 1;
    }
    write_checkpoint(argv[1], argv[2]);
    return 0;
}
