/* The public networks: which names of theirs are which of ours. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/convert/headed.h"
#include "lib/lab/convert/table.h"
#include "lib/lab/eval/iresnet.h"
#include "lib/lab/eval/lpips.h"
#include "lib/lab/eval/topiq.h"
#include "lib/net/config.h"
#include "lib/net/dinov2.h"
#include "lib/lab/train/fan.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"

/* ---- DINOv2 ------------------------------------------------------------- */

/* The transformers that a file may hold, by the width of their tokens. */
static const struct dinov2_config transformers[] = {
    {384, 12, 6, 14, DINOV2_GRID, 4, 0, false},         /* vits14 */
    {768, 12, 12, 14, DINOV2_GRID, 4, 0, false},        /* vitb14 */
};

/* Behind the names that the backbone has in a model file. */
#define DINO "backbone.dino_model."

/* The tensors that a network of this configuration has, under their own
 * names. */
static int network_take_transformer(struct convert *c, const char *prefix,
                                    const struct dinov2_config *config,
                                    struct error *err)
{
    struct dinov2 net;
    struct params ps;
    char text[120];
    int rc = -1;

    params_init(&ps);
    if (!dinov2_init(&net, &ps, DINO, config, true, err))
        rc = convert_take_params(c, 0, prefix, &ps, "", DINO, err);
    dinov2_release(&net);
    params_release(&ps);
    snprintf(text, sizeof text, "{\"type\":\"dinov2\",\"embed\":%zu,"
             "\"depth\":%zu,\"heads\":%zu,\"patch\":%zu,\"image\":518}",
             config->embed, config->depth, config->heads, config->patch);
    convert_set_meta(c, "backbone", text);
    return rc;
}

int convert_dinov2(struct convert *c, struct error *err)
{
    const size_t any[3] = {1, 1, 0};
    char prefix[TENSORFILE_NAME];
    size_t i;

    convert_prefix(prefix, c, 0, "cls_token");
    i = convert_find(c, 0, prefix, "cls_token", 3, any, false);
    if (i == SIZE_MAX)
        return 0;
    for (size_t k = 0; k < sizeof transformers / sizeof *transformers; k++)
        if (transformers[k].embed == tensorfile_at(c->file[0], i)->dim[2])
            return network_take_transformer(c, prefix, &transformers[k], err);
    convert_note(c, CONVERT_SHAPE, "tokens of %zu numbers (expected 384, "
                 "vits14, or 768, vitb14)",
                 tensorfile_at(c->file[0], i)->dim[2]);
    return 0;
}

/* ---- SMIRK -------------------------------------------------------------- */

#define SMIRK_EXP 50                /* expressions, then 2 lids, 3 jaw */
#define SMIRK_OUT (SMIRK_EXP + 5)
#define SMIRK_NET "tf_mobilenetv3_large_minimal_100"

/* Rows first.. of SMIRK's last layer (w, b), times gain, plus offset in the
 * bias, into a head of ours of `rows` rows that starts as it is. */
static int network_smirk_head(struct convert *c, const struct params *ps,
                              const char *name, const double *w,
                              const double *b, size_t first, size_t rows,
                              float gain, float offset, struct error *err)
{
    char text[64];
    float *out;

    for (int bias = 0; bias < 2; bias++) {
        snprintf(text, sizeof text, "motion.%s.%s", name,
                 bias ? "bias" : "weight");
        const struct param *p = &ps->tensor[params_find(ps, text)];
        size_t wide = p->count / p->dim[0];

        out = convert_add(c, text, ST_F32, p->ndim, p->dim, err);
        if (!out)
            return -1;
        memcpy(out, param_w(ps, params_find(ps, text)),
               p->count * sizeof *out);
        for (size_t k = 0; w && k < rows * wide; k++)
            out[k] = bias ? (float)b[first + k] * gain + offset
                          : (float)w[first * wide + k] * gain;
    }
    return 0;
}

/* E_m on the expression encoder.  Its lids are clamped to [0,1] where ours
 * pass a sigmoid: the same slope and value in the middle.  Pose has an encoder
 * of its own there and other units; ours starts as a new model does. */
static int network_smirk_motion(struct convert *c, const char *prefix,
                                const struct params *ps, struct error *err)
{
    const size_t features = 960, wd[2] = {SMIRK_OUT, features};
    size_t w = convert_find(c, 0, prefix,
                            "expression_encoder.expression_layers.0.weight",
                            2, wd, false);
    size_t b = convert_find(c, 0, prefix,
                            "expression_encoder.expression_layers.0.bias", 1,
                            wd, false);
    const double *weight, *bias;
    int rc = -1;

    if (w == SIZE_MAX || b == SIZE_MAX)
        return 0;
    if ((weight = convert_numbers(c, 0, w, &c->memory, err)) &&
        (bias = convert_numbers(c, 0, b, &c->memory, err)) &&
        !network_smirk_head(c, ps, "rot", NULL, NULL, 0, 0, 1, 0, err) &&
        !network_smirk_head(c, ps, "trans", NULL, NULL, 0, 0, 1, 0, err) &&
        !network_smirk_head(c, ps, "exp", weight, bias, 0, SMIRK_EXP, 1, 0,
                            err) &&
        !network_smirk_head(c, ps, "jaw", weight, bias, SMIRK_EXP + 2, 3, 1, 0,
                            err) &&
        !network_smirk_head(c, ps, "lid", weight, bias, SMIRK_EXP, 2, 4, -2,
                            err) &&
        !network_smirk_head(c, ps, "eye", NULL, NULL, 0, 0, 1, 0, err))
        rc = 0;
    convert_note(c, CONVERT_REMARK, "head pose, translation and gaze start "
                 "untrained: SMIRK has no layers for them that fit");
    return rc;
}

/* Declare E_m and E_beta with SMIRK's network in both. */
static int network_smirk_declare(struct params *ps,
                                 struct motion_encoder *motion,
                                 struct shape_encoder *shape, struct error *err)
{
    params_init(ps);
    memset(shape, 0, sizeof *shape);
    if (motion_encoder_init(motion, ps, "motion.", SMIRK_NET, err) ||
        shape_encoder_init(shape, ps, "shape.", SMIRK_NET, err) ||
        params_allocate(ps, err))
        return -1;
    motion_encoder_init_weights(motion);
    return 0;
}

/* The configuration of a model with these encoders, as its metadata. */
static void network_smirk_config(struct convert *c)
{
    struct avatar_config config;

    avatar_config_paper(&config);
    snprintf(config.motion_net, sizeof config.motion_net, SMIRK_NET);
    snprintf(config.shape_net, sizeof config.shape_net, SMIRK_NET);
    headed_describe(c, &config);
}

int convert_smirk(struct convert *c, struct error *err)
{
    struct motion_encoder motion;
    struct shape_encoder shape;
    struct params ps;
    char prefix[TENSORFILE_NAME];
    int rc = -1;

    convert_prefix(prefix, c, 0, "shape_encoder.shape_layers.0.weight");
    network_smirk_config(c);
    if (!network_smirk_declare(&ps, &motion, &shape, err) &&
        !convert_take_params(c, 0, prefix, &ps, "expression_encoder.encoder.",
                             "motion.encoder.", err) &&
        !network_smirk_motion(c, prefix, &ps, err) &&
        !convert_take_params(c, 0, prefix, &ps, "shape_encoder.encoder.",
                             "shape.encoder.", err))
        rc = convert_take_params(c, 0, prefix, &ps,
                                 "shape_encoder.shape_layers.0.",
                                 "shape.shape.", err);
    motion_encoder_release(&motion);
    shape_encoder_release(&shape);
    params_release(&ps);
    return rc;
}

/* ---- LPIPS -------------------------------------------------------------- */

/* AlexNet's convolutions: torchvision's names, and those of the LPIPS
 * package's own files. */
static const char *const alexnet[][2] = {
    {"features.0.", "net.slice1.0."}, {"features.3.", "net.slice2.3."},
    {"features.6.", "net.slice3.6."}, {"features.8.", "net.slice4.8."},
    {"features.10.", "net.slice5.10."},
};

int convert_lpips(struct convert *c, struct error *err)
{
    const int lin = c->with->linear ? convert_open(c, c->with->linear, err) : 0;
    const size_t any[4] = {0};
    char prefix[TENSORFILE_NAME];
    struct lpips net;
    bool sliced;
    int rc = lin < 0 ? -1 : 0;

    convert_prefix(prefix, c, 0, "net.slice1.0.weight");
    sliced = convert_find(c, 0, prefix, "net.slice1.0.weight", 4, any,
                          true) != SIZE_MAX;
    if (!sliced)
        convert_prefix(prefix, c, 0, "features.0.weight");
    lpips_declare(&net, LPIPS_ALEXNET);
    for (size_t i = 0; !rc && i < sizeof alexnet / sizeof *alexnet; i++)
        rc = convert_take_params(c, 0, prefix, &net.ps, alexnet[i][sliced],
                                 alexnet[i][0], err);
    if (!rc) {
        convert_prefix(prefix, c, lin, "lin0.model.1.weight");
        rc = convert_take_params(c, lin, prefix, &net.ps, "lin", "lin", err);
    }
    lpips_release(&net);
    return rc;
}

/* ---- ArcFace ------------------------------------------------------------ */

/* A file, and what its names begin with. */
struct network_file {
    const struct tensorfile *file;
    char prefix[TENSORFILE_NAME];
};

/* As iresnet_declare wants it. */
static size_t network_rows(const void *file, const char *name)
{
    const struct network_file *f = file;
    char text[2 * TENSORFILE_NAME];

    snprintf(text, sizeof text, "%s%s", f->prefix, name);
    const size_t i = tensorfile_find(f->file, text);

    return i < SIZE_MAX && tensorfile_at(f->file, i)->ndim
               ? tensorfile_at(f->file, i)->dim[0] : 0;
}

int convert_arcface(struct convert *c, struct error *err)
{
    struct iresnet *net = arena_take(&c->memory, 1, sizeof *net);
    struct network_file f = {.file = c->file[0]};
    int rc = arena_check(&c->memory, "a network", err);

    if (rc)
        return -1;
    convert_prefix(f.prefix, c, 0, "layer1.0.conv1.weight");
    rc = iresnet_declare(net, network_rows, &f, tensorfile_path(f.file), err) ||
         convert_take_params(c, 0, f.prefix, &net->ps, "", "", err) ? -1 : 0;
    iresnet_release(net);
    return rc;
}

/* ---- TopIQ -------------------------------------------------------------- */

/* Of the blocks that ask, attention among their own tokens, which the public
 * code has and never runs. */
static void network_pass_over_idle(struct convert *c, const char *prefix)
{
    for (size_t i = 0; i < tensorfile_count(c->file[0]); i++) {
        const char *name = tensorfile_at(c->file[0], i)->name;

        if (!strncmp(name, prefix, strlen(prefix)) &&
            !strncmp(name + strlen(prefix), "attn_blks.", 10) &&
            strstr(name, ".self_attn."))
            c->used[0][i] = true;
    }
}

int convert_topiq(struct convert *c, struct error *err)
{
    char prefix[TENSORFILE_NAME];
    struct topiq net;
    int rc = 0;

    topiq_declare(&net);
    convert_prefix(prefix, c, 0, "h_emb");
    for (size_t i = 0; !rc && i < net.ps.count; i++) {
        const struct param *p = &net.ps.tensor[i];
        char name[sizeof p->name], *at;

        /* "in_proj.weight" of ours is "in_proj_weight" there */
        memcpy(name, p->name, sizeof name);
        at = strstr(name, ".in_proj.");
        if (at)
            at[strlen(".in_proj")] = '_';
        rc = convert_take(c, 0, prefix, name, p->name, p->ndim, p->dim, err);
    }
    network_pass_over_idle(c, prefix);
    topiq_release(&net);
    return rc;
}

/* ---- SqueezeNet --------------------------------------------------------- */

/* torchvision's network sees (x - mean) / deviation, ours x in [0,1].  The
 * first convolution has no padding, so that its weights can do it exactly. */
static int network_squeeze_first(struct convert *c, const char *prefix,
                                 struct error *err)
{
    static const double mean[3] = {0.485, 0.456, 0.406};
    static const double deviation[3] = {0.229, 0.224, 0.225};
    const size_t dim[4] = {96, 3, 7, 7}, taps = 49;
    size_t wi = convert_find(c, 0, prefix, "features.0.weight", 4, dim, false);
    size_t bi = convert_find(c, 0, prefix, "features.0.bias", 1, dim, false);
    double *w, *b;
    float *out, *shift;

    if (wi == SIZE_MAX || bi == SIZE_MAX)
        return 0;
    w = convert_numbers(c, 0, wi, &c->memory, err);
    b = w ? convert_numbers(c, 0, bi, &c->memory, err) : NULL;
    out = b ? convert_add(c, "features.0.weight", ST_F32, 4, dim, err) : NULL;
    shift = out ? convert_add(c, "features.0.bias", ST_F32, 1, dim, err)
                : NULL;
    for (size_t o = 0; shift && o < dim[0]; o++) {
        double sum = b[o];

        for (size_t k = 0; k < 3 * taps; k++) {
            double v = w[o * 3 * taps + k] / deviation[k / taps];

            out[o * 3 * taps + k] = (float)v;
            sum -= v * mean[k / taps];
        }
        shift[o] = (float)sum;
    }
    return shift ? 0 : -1;
}

int convert_squeezenet(struct convert *c, struct error *err)
{
    const size_t classes[4] = {1000, 512, 1, 1};
    char prefix[TENSORFILE_NAME], name[40];
    struct lpips net;
    int rc;

    convert_prefix(prefix, c, 0, "features.0.weight");
    lpips_declare(&net, LPIPS_SQUEEZENET);
    rc = network_squeeze_first(c, prefix, err);
    for (int i = 1; !rc && i <= 12; i++) {      /* the first one is there */
        snprintf(name, sizeof name, "features.%d.", i);
        rc = convert_take_params(c, 0, prefix, &net.ps, name, name, err);
    }
    rc = rc || convert_take(c, 0, prefix, "classifier.1.weight",
                            "classifier.1.weight", 4, classes, err) ||
         convert_take(c, 0, prefix, "classifier.1.bias", "classifier.1.bias", 1,
                      classes, err) ? -1 : 0;
    lpips_release(&net);
    return rc;
}

/* ---- FAN ---------------------------------------------------------------- */

/* The tensors of a face alignment network of these sizes; its pictures are RGB
 * from 0 to 1 as they are. */
static int network_fan_take(struct convert *c, const char *prefix,
                            size_t stacks, size_t width, struct error *err)
{
    struct params ps;
    struct tape net;
    int rc;

    params_init(&ps);
    tape_init(&net, &ps, 3, true);
    fan_declare(&net, stacks, width);
    rc = convert_take_params(c, 0, prefix, &ps, "", "", err);
    tape_release(&net);
    params_release(&ps);
    return rc;
}

int convert_fan(struct convert *c, struct error *err)
{
    const size_t any[1] = {0};
    char prefix[TENSORFILE_NAME], name[40];
    size_t i, width = 0, stacks = 0;

    convert_prefix(prefix, c, 0, "m0.b1_4.bn1.weight");
    for (; stacks < FAN_STACKS; stacks++) {
        snprintf(name, sizeof name, "m%zu.b1_4.bn1.weight", stacks);
        i = convert_find(c, 0, prefix, name, 1, any, stacks > 0);
        if (i == SIZE_MAX)
            break;
        width = tensorfile_at(c->file[0], i)->dim[0];
    }
    if (!stacks)
        return 0;
    if (!width || width % 16 || width > FAN_WIDTH_MAX) {
        convert_note(c, CONVERT_SHAPE, "hourglasses of %zu channels (expected "
                     "a multiple of 16 up to %d)", width, FAN_WIDTH_MAX);
        return 0;
    }
    return network_fan_take(c, prefix, stacks, width, err);
}
