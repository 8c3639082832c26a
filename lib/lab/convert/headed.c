/* A model's encoders, and whole models, moved to another head: their last
 * layers are linear, so that the map between the heads' coefficients
 * (lib/lab/head/map.h) is multiplied into them. */
#include "lib/lab/convert/headed.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/convert/table.h"
#include "lib/lab/head/subdivide.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"

#define JAW 3
#define ZOOM 1.7f       /* a usual window over a usual crop */

/* ---- opening ------------------------------------------------------------ */

int headed_open(struct headed *h, const char *model, const char *from,
                const char *to, struct error *err)
{
    memset(h, 0, sizeof *h);
    if (model_open(&h->model, model, err))
        return -1;
    h->config = h->model.config;
    if (!to)
        return 0;
    if (head_load(&h->to, to, err))
        return -1;
    snprintf(h->config.head_hash, sizeof h->config.head_hash, "%s",
             h->to.hash);
    if (!strcmp(h->model.config.head_hash, h->to.hash))
        return 0;
    if (!from)
        return error_set(err, EX_USAGE, "%s: the model's head is %s, not that "
                         "of %s (expected the model's with --from-head)",
                         model, h->model.config.head_hash, to);
    if (head_load(&h->from, from, err))
        return -1;
    if (model_check_head(&h->model.config, &h->from, err))
        return error_prefix(err, "%s", from);
    if (subdivide_extends(&h->to, &h->from))
        return 0;
    h->moves = true;
    return head_map_init(&h->map, &h->from, &h->to, MOTION_JAW - MOTION_EXP,
                         SHAPE_ENCODER_OUT, err);
}

void headed_release(struct headed *h)
{
    if (h->moves)
        head_map_release(&h->map);
    head_release(&h->from);
    head_release(&h->to);
    model_close(&h->model);
    memset(h, 0, sizeof *h);
}

/* ---- linear layers ------------------------------------------------------ */

/* Tensor "<name>.weight" (bias: ".bias") of ps. */
static float *headed_layer(const struct params *ps, const char *name,
                           bool bias)
{
    char text[64];

    snprintf(text, sizeof text, "%s.%s", name, bias ? "bias" : "weight");
    return param_w(ps, params_find(ps, text));
}

/* Rows exp and jaw (wide numbers each) times the map. */
static int headed_map_motion(float *exp, float *jaw, size_t wide,
                             const struct head_map *m, struct error *err)
{
    const size_t rows = MOTION_JAW - MOTION_EXP;
    const size_t from = m->from->nexp, n = from + JAW;
    float *old = calloc((rows + JAW) * wide, sizeof *old);

    if (!old)
        return error_set(err, EX_OSERR, "out of memory");
    memcpy(old, exp, rows * wide * sizeof *old);
    memcpy(old + rows * wide, jaw, JAW * wide * sizeof *old);
    memset(exp, 0, rows * wide * sizeof *old);
    memset(jaw, 0, JAW * wide * sizeof *old);
    for (size_t i = 0; i < m->nexp + JAW; i++) {
        float *out = i < m->nexp ? exp + i * wide
                                 : jaw + (i - m->nexp) * wide;

        for (size_t j = 0; j < n; j++) {
            const size_t at = j < from ? j : rows + j - from;

            for (size_t k = 0; (j >= from || j < rows) && k < wide; k++)
                out[k] += m->motion[i * n + j] * old[at * wide + k];
        }
    }
    free(old);
    return 0;
}

/* shape (SHAPE_ENCODER_OUT,wide) times the map. */
static int headed_map_shape(float *shape, size_t wide,
                            const struct head_map *m, struct error *err)
{
    const size_t rows = SHAPE_ENCODER_OUT, n = m->from->nshape;
    float *old = malloc(rows * wide * sizeof *old);

    if (!old)
        return error_set(err, EX_OSERR, "out of memory");
    memcpy(old, shape, rows * wide * sizeof *old);
    memset(shape, 0, rows * wide * sizeof *old);
    for (size_t i = 0; i < m->nshape; i++)
        for (size_t j = 0; j < n && j < rows; j++)
            for (size_t k = 0; k < wide; k++)
                shape[i * wide + k] += m->shape[i * n + j] *
                                       old[j * wide + k];
    free(old);
    return 0;
}

/* The camera of a head whose origin lies elsewhere: t - R shift.  Rows 0 and 1
 * of R are what the encoder's 6D columns are before they are made square; their
 * length, which is free, is about what the biases (6) say.  The depth takes a
 * frontal head's. */
static void headed_shift(float *trans, const float *rot, size_t wide,
                         const float shift[3], const float biases[6],
                         bool bias)
{
    for (size_t k = 0; k < wide; k++) {
        for (size_t r = 0; r < 2; r++) {
            const float *b = biases + 3 * r;
            const float length = sqrtf(b[0] * b[0] + b[1] * b[1] +
                                       b[2] * b[2]) + 1e-6f;

            for (size_t i = 0; i < 3; i++)
                trans[r * wide + k] -= shift[i] / length *
                                       rot[(3 * r + i) * wide + k];
        }
        if (bias)
            trans[2 * wide + k] += shift[2] / ZOOM;
    }
}

/* All of them, weights and biases. */
static int headed_map(struct params *ps, size_t features, size_t shapes,
                      const struct head_map *m, struct error *err)
{
    for (int bias = 0; bias < 2; bias++) {
        const size_t wide = bias ? 1 : features;
        float *beta = headed_layer(ps, "shape.shape", bias);

        headed_shift(headed_layer(ps, "motion.trans", bias),
                     headed_layer(ps, "motion.rot", bias), wide, m->shift,
                     headed_layer(ps, "motion.rot", true), bias);
        if (headed_map_motion(headed_layer(ps, "motion.exp", bias),
                              headed_layer(ps, "motion.jaw", bias), wide, m,
                              err) ||
            headed_map_shape(beta, bias ? 1 : shapes, m, err))
            return -1;
        for (size_t i = 0; bias && i < m->nshape; i++)
            beta[i] += m->mean[i];
    }
    return 0;
}

/* ---- writing ------------------------------------------------------------ */

int headed_encoders(struct convert *c, const struct headed *h,
                    struct error *err)
{
    struct motion_encoder motion = {0};
    struct shape_encoder shape = {0};
    struct params ps;
    int rc = -1;

    params_init(&ps);
    if (motion_encoder_init(&motion, &ps, "motion.", h->config.motion_net,
                            err) ||
        shape_encoder_init(&shape, &ps, "shape.", h->config.shape_net, err) ||
        params_allocate(&ps, err) || model_load(&ps, &h->model, "", err))
        goto out;
    if (h->moves && headed_map(&ps, motion.net.features, shape.net.features,
                               &h->map, err))
        goto out;
    for (size_t i = 0; i < ps.count; i++) {
        const struct param *p = &ps.tensor[i];
        float *to = convert_add(c, p->name, ST_F32, p->ndim, p->dim, err);

        if (!to)
            goto out;
        memcpy(to, param_w(&ps, i), p->count * sizeof *to);
    }
    rc = 0;
out:
    motion_encoder_release(&motion);
    shape_encoder_release(&shape);
    params_release(&ps);
    return rc;
}

/* Per-vertex numbers at the new head's vertices. */
static int headed_vertices(struct convert *c, const struct headed *h,
                           const char *name, struct error *err)
{
    const size_t want[2] = {h->from.V, 0};
    const size_t i = convert_find(c, 0, "", name, 2, want, false);
    double *in = i == SIZE_MAX ? NULL
                               : convert_numbers(c, 0, i, &c->memory, err);
    float *own, *out;

    if (!in)
        return i == SIZE_MAX ? 0 : -1;
    const size_t wide = tensorfile_at(c->file[0], i)->dim[1];
    const size_t dim[2] = {h->to.V, wide};

    own = arena_take(&c->memory, h->from.V * wide, sizeof *own);
    out = convert_add(c, name, ST_F32, 2, dim, err);
    if (!out)
        return -1;
    for (size_t k = 0; k < h->from.V * wide; k++)
        own[k] = (float)in[k];
    head_map_vertices(out, own, wide, &h->map);
    return 0;
}

/* Tensor i of the model, unless it is an encoder's. */
static int headed_tensor(struct convert *c, const struct headed *h, size_t i,
                         struct error *err)
{
    const struct tensorfile_tensor *t = tensorfile_at(c->file[0], i);

    if (!strncmp(t->name, "motion.", 7) || !strncmp(t->name, "shape.", 6)) {
        c->used[0][i] = true;
        return 0;
    }
    if (h->moves && !strcmp(t->name, "dynamic.head_base"))
        return headed_vertices(c, h, t->name, err);
    return convert_take(c, 0, "", t->name, t->name, t->ndim, t->dim, err);
}

void headed_describe(struct convert *c, const struct avatar_config *config)
{
    char *json = avatar_config_print(config);

    convert_set_meta(c, "spid", json ? json : "");
    cJSON_free(json);
}

int convert_model(struct convert *c, struct error *err)
{
    struct headed h;
    int rc = -1;

    if (!c->with->head)
        return error_set(err, EX_USAGE, "no head to move the model to "
                         "(expected --head FILE, and --from-head FILE)");
    if (headed_open(&h, tensorfile_path(c->file[0]), c->with->from_head,
                    c->with->head, err))
        goto out;
    if (h.config.system != SYSTEM_SPID) {
        error_set(err, EX_CONFIG, "%s: the model is not SpiD's",
                  tensorfile_path(c->file[0]));
        goto out;
    }
    rc = headed_encoders(c, &h, err);
    for (size_t i = 0; rc == 0 && i < tensorfile_count(c->file[0]); i++)
        rc = headed_tensor(c, &h, i, err);
    headed_describe(c, &h.config);
    if (rc == 0 && h.moves)
        convert_note(c, CONVERT_REMARK, "expressions of the new head leave "
                     "%.0f %% of the old one's over", 100 * h.map.error);
out:
    headed_release(&h);
    return rc;
}
