/* MUSIQ: patches at three sizes, each through a small piece of ResNet, then a
 * transformer whose class token is the quality. */
#include "lib/lab/eval/musiq.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"

#define PATCH ((size_t)32)
#define STEM ((size_t)64)       /* channels before the bottleneck, */
#define TOKEN ((size_t)256)     /* behind it, */
#define MAP ((size_t)8)         /* where a patch is 8 x 8 */
#define WIDTH ((size_t)384)
#define HEADS ((size_t)6)
#define GRID ((size_t)10)
#define GROUPS ((size_t)32)     /* of a group norm */

/* Longer sides; the last size is the picture's own. */
static const size_t longer[MUSIQ_SCALES - 1] = {224, 384};

/* ---- tensors ------------------------------------------------------------ */

static const struct transformer_kind kind = {
    .norm1 = "norm1", .in = {"attention.qkv"}, .out = "attention.out",
    .norm2 = "norm2", .grow = "mlp.fc1", .shrink = "mlp.fc2",
    .widen = 3, .act = ACT_GELU, .eps1 = 1e-6f, .eps2 = 1e-6f
};

void musiq_declare(struct musiq *m)
{
    struct params *ps = &m->ps;
    const size_t position[3] = {1, GRID * GRID, WIDTH}, cls[3] = {1, 1, WIDTH};
    const size_t scale[2] = {MUSIQ_SCALES, WIDTH};
    static const char at[] = "transformer_encoder.";
    char name[120];

    memset(m, 0, sizeof *m);
    params_init(ps);
    conv_init(&m->root, ps, "conv_root", 3, STEM, 7, 2, false);
    m->root.pad = CONV_SAME;
    layer_norm_init(&m->gn_root, ps, "gn_root", STEM, 1e-6f);
    conv_init(&m->conv1, ps, "block1.conv1", STEM, STEM, 1, 1, false);
    layer_norm_init(&m->gn1, ps, "block1.gn1", STEM, 1e-4f);
    conv_init(&m->conv2, ps, "block1.conv2", STEM, STEM, 3, 1, false);
    layer_norm_init(&m->gn2, ps, "block1.gn2", STEM, 1e-4f);
    conv_init(&m->conv3, ps, "block1.conv3", STEM, TOKEN, 1, 1, false);
    layer_norm_init(&m->gn3, ps, "block1.gn3", TOKEN, 1e-4f);
    conv_init(&m->proj, ps, "block1.conv_proj", STEM, TOKEN, 1, 1, false);
    layer_norm_init(&m->gn_proj, ps, "block1.gn_proj", TOKEN, 1e-4f);
    linear_init(&m->embedding, ps, "embedding", MAP * MAP * TOKEN, WIDTH);
    m->position = params_add(ps, nn_name(name, "%sposembed_input.position_emb",
                                         at), 3, position, PARAM_ZERO, 0);
    m->scale = params_add(ps, nn_name(name, "%sscaleembed_input.scale_emb", at),
                          2, scale, PARAM_ZERO, 0);
    m->cls = params_add(ps, nn_name(name, "%scls", at), 3, cls, PARAM_ZERO, 0);
    layer_norm_init(&m->norm, ps, nn_name(name, "%sencoder_norm", at), WIDTH,
                    kind.eps1);
    for (int i = 0; i < MUSIQ_BLOCKS; i++)
        transformer_init(&m->block[i], ps,
                         nn_name(name, "%stransformer.encoderblock_%d.", at, i),
                         &kind, WIDTH, HEADS);
    linear_init(&m->head, ps, "head", WIDTH, 1);
}

int musiq_init(struct musiq *m, const char *path, struct error *err)
{
    musiq_declare(m);
    if (params_open(&m->ps, path, err) == 0)
        return 0;
    musiq_release(m);
    return -1;
}

/* ---- a plan for one size of picture -------------------------------------- */

void musiq_release(struct musiq *m)
{
    nn_plan_release(&m->plan);
    params_release(&m->ps);
    memset(m, 0, sizeof *m);
}

/* Patches along a side of n pixels. */
static size_t musiq_count(size_t n)
{
    return (n + PATCH - 1) / PATCH;
}

/* Sides of every size, and how many patches they are. */
static void musiq_sizes(struct musiq *m, size_t H, size_t W)
{
    const size_t side = H > W ? H : W;

    m->patches = 0;
    for (int s = 0; s < MUSIQ_SCALES; s++) {
        const double ratio = s < MUSIQ_SCALES - 1
                                 ? (double)longer[s] / (double)side : 1;

        m->h[s] = (size_t)fmax(1, rint((double)H * ratio));
        m->w[s] = (size_t)fmax(1, rint((double)W * ratio));
        m->patches += musiq_count(m->h[s]) * musiq_count(m->w[s]);
    }
}

/* What a patch passes alone; maps of pixels are (patches,side,side,C). */
static void musiq_plan_stem(struct musiq *m, size_t H, size_t W)
{
    struct nn_plan *p = &m->plan;
    const size_t n = m->patches, pixels = n * MAP * MAP;

    m->picture = nn_plan_floats(p, 3 * H * W);
    for (int s = 0; s < MUSIQ_SCALES; s++) {
        m->size[s] = nn_plan_floats(p, 3 * m->h[s] * m->w[s]);
        rescale_plan(&m->resize[s], p, RESCALE_BICUBIC, 1, H, W, m->h[s],
                     m->w[s], 3);
    }
    m->rgb = nn_plan_floats(p, n * PATCH * PATCH * 3);
    m->root_out = nn_plan_floats(p, 4 * pixels * STEM);
    for (int i = 0; i < 3; i++)
        m->narrow[i] = nn_plan_floats(p, pixels * STEM);
    for (int i = 0; i < 2; i++)
        m->wide[i] = nn_plan_floats(p, pixels * TOKEN);
    conv_plan(&m->root, p, n, PATCH, PATCH);
    /* the public definition pads the last windows with zeros: behind a relu
     * that is the same as cutting them off */
    max_pool_plan(&m->pool, p, n, 2 * MAP, 2 * MAP, STEM, 0, true);
    conv_plan(&m->conv1, p, n, MAP, MAP);
    conv_plan(&m->conv2, p, n, MAP, MAP);
    conv_plan(&m->conv3, p, n, MAP, MAP);
    conv_plan(&m->proj, p, n, MAP, MAP);
    linear_plan(&m->embedding, p, n);
}

/* The transformer over T tokens. */
static void musiq_plan_encoder(struct musiq *m, size_t T)
{
    struct nn_plan *p = &m->plan;

    m->x = nn_plan_floats(p, T * WIDTH);
    m->n = nn_plan_floats(p, T * WIDTH);
    m->hidden = nn_plan_floats(p, T * kind.widen * WIDTH);
    m->quality = nn_plan_floats(p, 1);
    attention_plan(&m->attention, p, 1, T, HEADS, WIDTH / HEADS);
    for (int i = 0; i < MUSIQ_BLOCKS; i++) {
        transformer_use(&m->block[i], m->x, m->n, m->hidden, m->hidden);
        transformer_plan(&m->block[i], p, T);
    }
    linear_plan(&m->head, p, 1);
}

/* For pictures of H x W. */
static int musiq_plan(struct musiq *m, size_t H, size_t W, struct error *err)
{
    const struct nn_options opt = {NN_INFER, NN_F32};

    m->H = m->W = 0;
    nn_plan_release(&m->plan);
    nn_plan_init(&m->plan, opt);
    musiq_sizes(m, H, W);
    musiq_plan_stem(m, H, W);
    musiq_plan_encoder(m, m->patches + 1);
    if (nn_plan_finish(&m->plan, err))
        return -1;
    m->H = H;
    m->W = W;
    return 0;
}

/* ---- one picture ---------------------------------------------------------- */

/* Patches of in (h,w,3), zeros around; returns how many. */
static size_t musiq_cut(float *patch, const float *in, size_t h, size_t w)
{
    const size_t rows = musiq_count(h), cols = musiq_count(w);
    const size_t top = (rows * PATCH - h) / 2, left = (cols * PATCH - w) / 2;

    memset(patch, 0, rows * cols * PATCH * PATCH * 3 * sizeof *patch);
    for (size_t y = 0; y < h; y++)
        for (size_t x = 0; x < w; x++) {
            const size_t Y = y + top, X = x + left;
            const size_t n = Y / PATCH * cols + X / PATCH;

            memcpy(patch + ((n * PATCH + Y % PATCH) * PATCH + X % PATCH) * 3,
                   in + (y * w + x) * 3, 3 * sizeof *patch);
        }
    return rows * cols;
}

/* The grid's cell of patch i of n along an axis, as torch's nearest
 * interpolation has it, in float. */
static size_t musiq_hash(size_t i, size_t n)
{
    const float cell = floorf((float)i * ((float)GRID / (float)n));

    return cell < (float)GRID ? (size_t)cell : GRID - 1;
}

/* x (rows cols,WIDTH) += where each patch is, and its size's embedding. */
static void musiq_add_places(float *x, const struct musiq *m, int s)
{
    const size_t rows = musiq_count(m->h[s]), cols = musiq_count(m->w[s]);
    const float *scale = param_w(&m->ps, m->scale) + (size_t)s * WIDTH;

    for (size_t i = 0; i < rows * cols; i++) {
        const size_t cell = musiq_hash(i / cols, rows) * GRID +
                            musiq_hash(i % cols, cols);
        const float *place = param_w(&m->ps, m->position) + cell * WIDTH;

        for (size_t k = 0; k < WIDTH; k++)
            x[i * WIDTH + k] += place[k] + scale[k];
    }
}

/* One patch of musiq_group_norm. */
PARALLEL(musiq_group_norm_part, i, float *, x, const float *, add,
         const struct layer_norm *, norm, size_t, pixels, _Bool, relu)
{
    const float *weight = param_w(norm->ps, norm->weight);
    const float *bias = param_w(norm->ps, norm->bias);
    const size_t C = norm->channels, width = C / GROUPS;
    float *p = x + i * pixels * C;

    for (size_t c0 = 0; c0 < C; c0 += width) {
        const double n = (double)(pixels * width);
        double sum = 0, square = 0;

        for (size_t j = 0; j < pixels * width; j++)
            sum += (double)p[j / width * C + c0 + j % width];
        for (size_t j = 0; j < pixels * width; j++) {
            const double d = (double)p[j / width * C + c0 + j % width] -
                             sum / n;

            square += d * d;
        }
        const double rstd = 1 / sqrt(square / n + (double)norm->eps);

        for (size_t j = 0; j < pixels * width; j++) {
            const size_t c = c0 + j % width, k = j / width * C + c;
            double y = ((double)p[k] - sum / n) * rstd * (double)weight[c] +
                       (double)bias[c];

            y += add ? (double)add[i * pixels * C + k] : 0;
            p[k] = (float)(relu && y < 0 ? 0 : y);
        }
    }
}

/* x (patches,pixels,C) in place: each patch's groups of channels to mean 0 and
 * variance 1, weighted; plus add (NULL: none); relu where wanted. */
static void musiq_group_norm(float *x, const struct musiq *m,
                             const struct layer_norm *norm, size_t pixels,
                             const float *add, bool relu)
{
    parallel_each(musiq_group_norm_part, m->patches, 1, x, add, norm, pixels,
                  relu);
}

/* Tokens of the patches in m->rgb, behind the class token's place in m->x. */
static void musiq_stem(struct musiq *m)
{
    const size_t pixels = MAP * MAP;
    float **a = m->narrow;

    conv_forward(m->root_out, m->rgb, &m->root);
    musiq_group_norm(m->root_out, m, &m->gn_root, 4 * pixels, NULL, true);
    max_pool_forward(a[0], m->root_out, &m->pool);
    conv_forward(m->wide[0], a[0], &m->proj);
    musiq_group_norm(m->wide[0], m, &m->gn_proj, pixels, NULL, false);
    conv_forward(a[1], a[0], &m->conv1);
    musiq_group_norm(a[1], m, &m->gn1, pixels, NULL, true);
    conv_forward(a[2], a[1], &m->conv2);
    musiq_group_norm(a[2], m, &m->gn2, pixels, NULL, true);
    conv_forward(m->wide[1], a[2], &m->conv3);
    musiq_group_norm(m->wide[1], m, &m->gn3, pixels, m->wide[0], true);
    conv_forward(m->x + WIDTH, m->wide[1], &m->embedding);
}

/* The transformer on m->x; the class token's quality. */
static double musiq_encode(struct musiq *m)
{
    for (int i = 0; i < MUSIQ_BLOCKS; i++)
        transformer_forward(NULL, &m->block[i], &m->attention);
    layer_norm_forward(m->n, NULL, m->x, &m->norm, 1);
    conv_forward(m->quality, m->n, &m->head);
    return (double)*m->quality;
}

int musiq_quality(double *quality, struct musiq *m, const float *rgb,
                  size_t H, size_t W, struct error *err)
{
    float *patch, *token;

    if ((H != m->H || W != m->W) && musiq_plan(m, H, W, err))
        return -1;
    for (size_t i = 0; i < H * W; i++)
        for (size_t c = 0; c < 3; c++)
            m->picture[3 * i + c] = 2 * rgb[c * H * W + i] - 1;
    patch = m->rgb;
    for (int s = 0; s < MUSIQ_SCALES; s++) {
        rescale_forward(m->size[s], m->picture, &m->resize[s]);
        patch += musiq_cut(patch, m->size[s], m->h[s], m->w[s]) * PATCH *
                 PATCH * 3;
    }
    musiq_stem(m);
    memcpy(m->x, param_w(&m->ps, m->cls), WIDTH * sizeof *m->x);
    token = m->x + WIDTH;
    for (int s = 0; s < MUSIQ_SCALES; s++) {
        musiq_add_places(token, m, s);
        token += musiq_count(m->h[s]) * musiq_count(m->w[s]) * WIDTH;
    }
    *quality = musiq_encode(m);
    return 0;
}
