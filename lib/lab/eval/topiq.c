/* TopIQ: what a picture shows decides which of its details count. */
#include "lib/lab/eval/topiq.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/image.h"

#define WIDTH ((size_t)256)     /* of a token */
#define HEADS ((size_t)4)
#define GATE ((size_t)64)       /* channels of a gate */
#define GRID ((size_t)32)       /* places along a side */

static const float mean[3] = {0.485f, 0.456f, 0.406f};
static const float deviation[3] = {0.229f, 0.224f, 0.225f};

/* ---- tensors ------------------------------------------------------------ */

static const struct transformer_kind self = {
    .norm1 = "norm1", .in = {"self_attn.in_proj"}, .out = "self_attn.out_proj",
    .norm2 = "norm2", .grow = "linear1", .shrink = "linear2", .widen = 4,
    .act = ACT_GELU, .eps1 = NORM_EPS, .eps2 = NORM_EPS
};
static const struct transformer_kind cross = {
    .norm1 = "norm1", .in = {"multihead_attn.in_proj"},
    .out = "multihead_attn.out_proj", .norm2 = "norm3", .grow = "linear1",
    .shrink = "linear2", .widen = 4, .act = ACT_GELU,
    .eps1 = NORM_EPS, .eps2 = NORM_EPS
};

/* The way to the tokens of level i, from maps of C channels. */
static void topiq_declare_level(struct topiq_level *l, struct params *ps,
                                int i, size_t C)
{
    static const size_t kernel[3] = {1, 3, 3};
    char name[120];

    conv_init(&l->split, ps, nn_name(name, "weight_pool.%d.splitconv", i), C,
              2 * C, 1, 1, true);
    for (int k = 0; k < 3; k++) {
        conv_init(&l->gate[k], ps,
                  nn_name(name, "weight_pool.%d.weight_blk.%d", i, 2 * k),
                  k ? GATE : C, k == 2 ? 1 : GATE, kernel[k], 1, true);
        l->gate[k].act = k == 2 ? ACT_SIGMOID : ACT_GELU;
    }
    conv_init(&l->reduce, ps, nn_name(name, "dim_reduce.%d.0", i), C, WIDTH, 1,
              1, true);
    l->reduce.act = ACT_GELU;
    transformer_init(&l->self, ps,
                     nn_name(name, "sa_attn_blks.%d.layers.0.", i), &self,
                     WIDTH, HEADS);
}

/* Number i of cross attention, which the last level but one answers first. */
static void topiq_declare_cross(struct topiq_cross *c, struct params *ps, int i)
{
    char at[120], name[120];

    nn_name(at, "attn_blks.%d.layers.0.", i);
    layer_norm_init(&c->norm, ps, nn_name(name, "%snorm2", at), WIDTH, NORM_EPS);
    transformer_init(&c->query, ps, at, &cross, WIDTH, HEADS);
}

void topiq_declare(struct topiq *t)
{
    struct params *ps = &t->ps;
    const size_t row[4] = {1, WIDTH / 2, GRID, 1};
    const size_t column[4] = {1, WIDTH / 2, 1, GRID};
    char name[120];

    memset(t, 0, sizeof *t);
    params_init(ps);
    tape_init(&t->resnet, ps, 3, true);
    resnet_declare(t->map, &t->resnet, "semantic_model.");
    for (int i = 0; i < RESNET_LEVELS; i++)
        topiq_declare_level(&t->level[i], ps, i,
                            i ? (size_t)128 << i : GATE);
    for (int i = 0; i < RESNET_LEVELS - 1; i++)
        topiq_declare_cross(&t->cross[i], ps, i);
    transformer_init(&t->last, ps, "attn_pool.", &self, WIDTH, HEADS);
    for (int i = 0; i < 2; i++)
        layer_norm_init(&t->score_norm[i], ps,
                        nn_name(name, "score_linear.%d", 3 * i), WIDTH, NORM_EPS);
    for (int i = 0; i < 3; i++) {
        linear_init(&t->score[i], ps,
                    nn_name(name, "score_linear.%d", i == 2 ? 6 : 3 * i + 1),
                    WIDTH, i == 2 ? 1 : WIDTH);
        t->score[i].act = i == 2 ? ACT_NONE : ACT_GELU;
    }
    t->row = params_add(ps, "h_emb", 4, row, PARAM_ZERO, 0);
    t->column = params_add(ps, "w_emb", 4, column, PARAM_ZERO, 0);
}

int topiq_init(struct topiq *t, const char *path, struct error *err)
{
    topiq_declare(t);
    if (params_open(&t->ps, path, err) == 0)
        return 0;
    topiq_release(t);
    return -1;
}

void topiq_release(struct topiq *t)
{
    tape_release(&t->resnet);
    nn_plan_release(&t->plan);
    params_release(&t->ps);
    memset(t, 0, sizeof *t);
}

/* ---- a plan for one size of picture -------------------------------------- */

/* A block over all tokens, which are the caller's. */
static void topiq_plan_block(struct topiq *t, struct transformer *b,
                             float *tokens)
{
    transformer_use(b, tokens, t->n, t->qkv, t->hidden);
    transformer_plan(b, &t->plan, t->tokens);
}

/* From the map of ResNet's level i to tokens, h x w of them. */
static void topiq_plan_level(struct topiq *t, int i, size_t h, size_t w)
{
    const struct tape_step *in = t->resnet.map[t->map[i]];
    struct topiq_level *l = &t->level[i];
    const size_t pixels = in->h * in->w, C = in->channels;
    struct nn_plan *p = &t->plan;

    l->both = nn_plan_map(p, pixels * 2 * C);
    for (int k = 0; k < 2; k++) {
        l->half[k] = nn_plan_map(p, pixels * C);
        l->narrow[k] = nn_plan_map(p, pixels * GATE);
    }
    l->weight = nn_plan_map(p, pixels);
    l->pooled = nn_plan_map(p, h * w * C);
    l->tokens = nn_plan_map(p, h * w * WIDTH);
    conv_plan(&l->split, p, 1, in->h, in->w);
    for (int k = 0; k < 3; k++)
        conv_plan(&l->gate[k], p, 1, in->h, in->w);
    rescale_plan(&l->pool, p, RESCALE_TOUCHED, 1, in->h, in->w, h, w, C);
    conv_plan(&l->reduce, p, 1, h, w);
    topiq_plan_block(t, &l->self, l->tokens);
    float *const done[] = {l->both, l->half[0], l->half[1], l->narrow[0],
                           l->narrow[1], l->weight, l->pooled};

    for (size_t k = 0; k < sizeof done / sizeof *done; k++)
        nn_plan_recycle(p, done[k]);
}

/* What asks the levels, and ends in one number. */
static void topiq_plan_end(struct topiq *t)
{
    float *query = t->level[RESNET_LEVELS - 1].tokens;
    struct nn_plan *p = &t->plan;

    for (int i = 0; i < RESNET_LEVELS - 1; i++)
        topiq_plan_block(t, &t->cross[i].query, query);
    topiq_plan_block(t, &t->last, query);
    for (int i = 0; i < 3; i++)
        linear_plan(&t->score[i], p, 1);
    for (int i = 0; i < 2; i++)
        t->mean[i] = nn_plan_floats(p, WIDTH);
    t->quality = nn_plan_floats(p, 1);
}

/* What all blocks share: for tokens of h x w. */
static void topiq_plan_blocks(struct topiq *t, size_t h, size_t w)
{
    struct nn_plan *p = &t->plan;

    t->tokens = h * w;
    t->places = nn_plan_floats(p, t->tokens * WIDTH);
    t->n = nn_plan_floats(p, t->tokens * WIDTH);
    t->qkv = nn_plan_floats(p, t->tokens * 3 * WIDTH);
    t->hidden = nn_plan_floats(p, t->tokens * self.widen * WIDTH);
    attention_plan(&t->attention, p, 1, t->tokens, HEADS, WIDTH / HEADS);
}

/* t->places: the grid's rows and columns, resized to the tokens' (at once would
 * be the same: the ones do not vary where the others do), side by side. */
static void topiq_find_places(struct topiq *t, struct rescale *rows,
                              struct rescale *columns, float *grid, float *line)
{
    const float *embedding[2] = {param_w(&t->ps, t->row),
                                 param_w(&t->ps, t->column)};
    const size_t w = columns->x.out, half = WIDTH / 2;

    for (int axis = 0; axis < 2; axis++) {
        for (size_t i = 0; i < GRID * half; i++)
            grid[i] = embedding[axis][i % half * GRID + i / half];
        rescale_forward(line, grid, axis ? columns : rows);
        for (size_t i = 0; i < t->tokens; i++)
            memcpy(t->places + i * WIDTH + (size_t)axis * half,
                   line + (axis ? i % w : i / w) * half, half * sizeof *line);
    }
}

/* For pictures of H x W. */
static int topiq_plan(struct topiq *t, size_t H, size_t W, struct error *err)
{
    const struct nn_options opt = {NN_INFER, NN_F32};
    const size_t h = (H + 31) / 32, w = (W + 31) / 32, half = WIDTH / 2;
    struct nn_plan *p = &t->plan;
    struct rescale rows, columns;

    t->H = t->W = 0;
    nn_plan_release(p);
    nn_plan_init(p, opt);
    if (tape_plan(&t->resnet, 1, H, W, opt, err))
        return -1;
    t->picture = nn_plan_floats(p, 3 * H * W);
    topiq_plan_blocks(t, h, w);
    for (int i = 0; i < RESNET_LEVELS; i++)
        topiq_plan_level(t, i, h, w);
    topiq_plan_end(t);
    rescale_plan(&rows, p, RESCALE_BICUBIC, 1, GRID, 1, h, 1, half);
    rescale_plan(&columns, p, RESCALE_BICUBIC, 1, 1, GRID, 1, w, half);
    float *grid = nn_plan_map(p, GRID * half);
    float *line = nn_plan_map(p, (h > w ? h : w) * half);

    if (nn_plan_finish(p, err))
        return -1;
    topiq_find_places(t, &rows, &columns, grid, line);
    t->H = H;
    t->W = W;
    return 0;
}

/* ---- one picture ---------------------------------------------------------- */

/* One pixel. */
PARALLEL(topiq_gate_part, i, float *, x, const float *, weight, size_t, C)
{
    for (size_t c = 0; c < C; c++)
        x[i * C + c] *= weight[i];
}

/* Tokens of a level. */
static void topiq_look(struct topiq *t, int i)
{
    const struct tape_step *in = t->resnet.map[t->map[i]];
    const size_t pixels = in->h * in->w, C = in->channels;
    struct topiq_level *l = &t->level[i];

    conv_forward(l->both, in->x, &l->split);
    for (size_t k = 0; k < 2; k++)
        concat_take(l->half[k], l->both, pixels, k * C, C, 2 * C);
    act_forward(l->half[0], l->half[0], ACT_GELU, pixels * C);
    conv_forward(l->narrow[0], l->half[1], &l->gate[0]);
    conv_forward(l->narrow[1], l->narrow[0], &l->gate[1]);
    conv_forward(l->weight, l->narrow[1], &l->gate[2]);
    parallel_each(topiq_gate_part, pixels, 64, l->half[0], l->weight, C);
    rescale_forward(l->pooled, l->half[0], &l->pool);
    conv_forward(l->tokens, l->pooled, &l->reduce);
    image_add(l->tokens, t->places, t->tokens * WIDTH);
    transformer_forward(NULL, &l->self, &t->attention);
}

/* The tokens so far ask others (T,WIDTH). */
static void topiq_ask(struct topiq *t, struct topiq_cross *c,
                      const float *others)
{
    float *theirs = t->hidden;

    transformer_attend(&c->query, 0);
    layer_norm_forward(t->n, NULL, others, &c->norm, t->tokens);
    conv_forward(theirs, t->n, &c->query.in[0]);
    for (size_t i = 0; i < t->tokens; i++)      /* keys and values */
        memcpy(t->qkv + (3 * i + 1) * WIDTH, theirs + (3 * i + 1) * WIDTH,
               2 * WIDTH * sizeof *theirs);
    attention_forward(t->n, t->qkv, &t->attention);
    transformer_feed(NULL, &c->query);
}

/* The quality of all tokens. */
static double topiq_score(struct topiq *t)
{
    const float *x = t->last.x;

    for (size_t c = 0; c < WIDTH; c++) {
        double sum = 0;

        for (size_t i = 0; i < t->tokens; i++)
            sum += (double)x[i * WIDTH + c];
        t->mean[0][c] = (float)(sum / (double)t->tokens);
    }
    for (int i = 0; i < 2; i++) {
        layer_norm_forward(t->mean[1], NULL, t->mean[0], &t->score_norm[i], 1);
        conv_forward(t->mean[0], t->mean[1], &t->score[i]);
    }
    conv_forward(t->quality, t->mean[0], &t->score[2]);
    return (double)*t->quality;
}

int topiq_quality(double *quality, struct topiq *t, const float *rgb,
                  size_t H, size_t W, struct error *err)
{
    if ((H != t->H || W != t->W) && topiq_plan(t, H, W, err))
        return -1;
    for (size_t i = 0; i < H * W; i++)
        for (size_t c = 0; c < 3; c++)
            t->picture[3 * i + c] =
                (rgb[c * H * W + i] - mean[c]) / deviation[c];
    tape_forward(NULL, t->picture, &t->resnet);
    for (int i = 0; i < RESNET_LEVELS; i++)
        topiq_look(t, i);
    for (int i = 0; i < RESNET_LEVELS - 1; i++)
        topiq_ask(t, &t->cross[i], t->level[RESNET_LEVELS - 2 - i].tokens);
    transformer_forward(NULL, &t->last, &t->attention);
    *quality = topiq_score(t);
    return 0;
}
