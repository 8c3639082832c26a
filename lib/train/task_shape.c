/* E_beta alone: supervised by the true shapes of rendered crops.  The error
 * of a shape is a quadratic form of beta - beta*, so no vertex is made. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/shape_encoder.h"
#include "lib/train/sheet.h"
#include "lib/train/task.h"

#define N SHAPE_ENCODER_SIZE
#define OUT SHAPE_ENCODER_OUT
#define MOST 256 /* items of one pass */

struct impl {
    struct shape_encoder net;
    struct params judge_ps;
    struct shape_encoder judge;
    size_t n;                   /* directions of the head, at most OUT */
    double *gram;               /* (n,n) S^T S / 3V, less similarities */
    float *rgb, *out, *dout;
};

static void release(struct task *t)
{
    struct impl *m = t->impl;

    if (!m)
        return;
    shape_encoder_release(&m->net);
    shape_encoder_release(&m->judge);
    params_release(&m->judge_ps);
    free(m->gram);
    free(m->rgb);
    free(m);
    t->impl = NULL;
}

/* Inner products of the shape directions over all vertices. */
static void fill_gram(double *gram, const struct head *h, size_t n)
{
    for (size_t b = 0; b < h->blocks; b++) {
        const float *d = h->shape_dirs + b * h->nshape * 96;
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j <= i; j++) {
                double sum = 0;
                for (size_t k = 0; k < 96; k++)
                    sum += (double)d[i * 96 + k] * d[j * 96 + k];
                gram[i * n + j] += sum / (3.0 * (double)h->V);
            }
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i; j++)
            gram[j * n + i] = gram[i * n + j];
}

/* unit (4,blocks*96): what moving the mean head and making it larger do to its
 * vertices, in the blocks' layout, each of length 1. */
static void similarities(double *unit, const struct head *h)
{
    size_t n = h->blocks * 96;
    double mean[3] = {0};

    for (size_t i = 0; i < 3 * h->V; i++)
        mean[i % 3] += (double)h->v_template[i] / (double)h->V;
    for (size_t v = 0; v < h->V; v++)
        for (size_t c = 0; c < 3; c++) {
            size_t at = v / HEAD_BLOCK * 96 + c * HEAD_BLOCK + v % HEAD_BLOCK;
            unit[c * n + at] = 1;
            unit[3 * n + at] = (double)h->v_template[3 * v + c] - mean[c];
        }
    for (size_t j = 0; j < 4; j++) {
        double sum = 0;
        for (size_t i = 0; i < n; i++)
            sum += unit[j * n + i] * unit[j * n + i];
        for (size_t i = 0; i < n; i++)
            unit[j * n + i] /= sqrt(sum);
    }
}

/* Take size and place out of the directions that gram is of: a small head
 * near by and a large one further off look the same, and E_m's translation
 * makes up for either. */
static int forgive_similarity(double *gram, const struct head *h, size_t n,
                              struct error *err)
{
    size_t count = h->blocks * 96;
    double *unit = calloc(4 * count, sizeof *unit);
    double *along = calloc(4 * n, sizeof *along);

    if (!unit || !along) {
        free(unit);
        free(along);
        return error_set(err, EX_OSERR, "out of memory");
    }
    similarities(unit, h);
    for (size_t j = 0; j < 4; j++)
        for (size_t b = 0; b < h->blocks; b++)
            for (size_t i = 0; i < n; i++) {
                const float *d = h->shape_dirs + (b * h->nshape + i) * 96;
                for (size_t k = 0; k < 96; k++)
                    along[4 * i + j] += unit[j * count + b * 96 + k] *
                                        (double)d[k];
            }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            for (size_t k = 0; k < 4; k++)
                gram[i * n + j] -= along[4 * i + k] * along[4 * j + k] /
                                   (3.0 * (double)h->V);
    free(unit);
    free(along);
    return 0;
}

/* Root mean square over coordinates of the vertices' difference, whatever
 * size and place would undo left out; g (n, or
 * NULL) is its gradient by beta. */
static double shape_error(double *g, const float *beta, const float *truth,
                          const struct impl *m)
{
    double d[OUT], sum = 0, rms;

    for (size_t i = 0; i < m->n; i++)
        d[i] = (double)beta[i] - truth[i];
    for (size_t i = 0; i < m->n; i++) {
        double row = 0;
        for (size_t j = 0; j < m->n; j++)
            row += m->gram[i * m->n + j] * d[j];
        if (g)
            g[i] = row;
        sum += d[i] * row;
    }
    rms = sqrt(fmax(sum, 0) + 1e-12);
    for (size_t i = 0; g && i < m->n; i++)
        g[i] /= rms;
    return rms;
}

static int pass(struct task *t, double *parts, uint64_t step, size_t micro,
                struct error *err)
{
    struct impl *m = t->impl;
    const struct train_config *c = t->config;
    size_t B = (size_t)c->micro;
    const struct data_person *who[MOST];
    double scale = 1.0 / (double)c->batch, g[OUT];
    double vertex = c->geometry.term[TERM_VERTEX];
    double direct = c->geometry.term[TERM_EXP] / OUT;

    for (size_t i = 0; i < B; i++) {
        struct random r;
        const struct data_frame *f;
        data_random(&r, (uint64_t)c->seed, step, micro * B + i);
        f = task_draw(t, &who[i], &r);
        if (data_sample(m->rgb + i * N * N * 3, N, f,
                        data_jitter(f, c->augment.jitter, &r), &c->augment,
                        &r, err))
            return -1;
    }
    shape_encoder_forward(m->out, m->rgb, &m->net);
    for (size_t i = 0; i < B; i++) {
        const float *o = m->out + i * OUT, *truth = who[i]->shape;
        float *d = m->dout + i * OUT;
        parts[0] += scale * vertex * shape_error(g, o, truth, m);
        for (size_t k = 0; k < OUT; k++) {
            double e = (double)o[k] - truth[k];
            parts[1] += scale * direct * fabs(e);
            d[k] = (float)(scale * (direct * ((e > 0) - (e < 0)) +
                                    (k < m->n ? vertex * g[k] : 0)));
        }
    }
    shape_encoder_backward(NULL, m->dout, &m->net);
    return 0;
}

static void update(struct task *t)
{
    struct impl *m = t->impl;

    shape_encoder_update(&m->net);
}

/* Error of the shape found from the first frame of each person, of the mean
 * head, and their ratio. */
static int held(struct task *t, double *figures, struct error *err)
{
    struct impl *m = t->impl;
    float zero[OUT] = {0};
    double mm = 1000 / (double)t->head->scale;

    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    shape_encoder_update(&m->judge);
    figures[0] = figures[1] = 0;
    for (size_t i = 0; i < t->nheld; i++) {
        const struct data_person *p = &t->held[i];
        const struct data_frame *f = &p->frame[0];
        if (data_sample(m->rgb, N, f, f->crop, NULL, NULL, err))
            return -1;
        shape_encoder_forward(m->out, m->rgb, &m->judge);
        figures[0] += mm * shape_error(NULL, m->out, p->shape, m) /
                      (double)t->nheld;
        figures[1] += mm * shape_error(NULL, zero, p->shape, m) /
                      (double)t->nheld;
    }
    figures[2] = figures[1] > 0 ? figures[0] / figures[1] : 0;
    return 0;
}

/* The crops E_beta sees; there is nothing to draw on them. */
static int make_sheet(struct task *t, uint8_t **rgb, size_t *H, size_t *W,
                      struct error *err)
{
    struct impl *m = t->impl;
    struct sheet sh;

    if (sheet_init(&sh, 2, 6, N, err))
        return -1;
    for (size_t i = 0; i < 12 && i < t->nheld; i++) {
        const struct data_frame *f = &t->held[i].frame[0];
        if (data_sample(m->rgb, N, f, f->crop, NULL, NULL, err)) {
            sheet_release(&sh);
            return -1;
        }
        sheet_picture(&sh, i / 6, i % 6, m->rgb, NULL);
    }
    sheet_take(&sh, rgb, H, W);
    return 0;
}

static const struct task_type type = {
    "shape.", 1.5, release, pass, update, held, make_sheet};

static int judge_init(struct task *t, const char *net, struct error *err)
{
    struct impl *m = t->impl;
    struct nn_options opt = {NN_INFER, NN_F32};

    params_init(&m->judge_ps);
    if (shape_encoder_init(&m->judge, &m->judge_ps, "shape.", net, err) ||
        params_allocate(&m->judge_ps, err))
        return -1;
    memcpy(m->judge_ps.w, t->ps.w, t->ps.total * sizeof *t->ps.w);
    return shape_encoder_plan(&m->judge, 1, opt, err);
}

int task_shape_init(struct task *t, struct error *err)
{
    const struct train_config *c = t->config;
    size_t B = (size_t)c->micro, n = N * N * 3;
    struct nn_options opt = {NN_TRAIN, NN_F32};
    struct impl *m = calloc(1, sizeof *m);
    char net[64];

    if (!m)
        return error_set(err, EX_OSERR, "out of memory");
    t->impl = m;
    t->type = &type;
    if (B > MOST)
        return error_set(err, EX_CONFIG, "micro: %zu (expected at most %d "
                         "in this stage)", B, MOST);
    t->nparts = 2;
    t->part_name[0] = "vertex";
    t->part_name[1] = "beta";
    t->nfigures = 3;
    t->held_name[0] = "shape_rms_mm";
    t->held_name[1] = "mean_head_rms_mm";
    t->held_name[2] = "ratio";
    task_net(net, sizeof net, c, "shape", "tf_mobilenetv3_large_minimal_100");
    m->n = t->head->nshape < OUT ? t->head->nshape : OUT;
    m->gram = calloc(m->n * m->n, sizeof *m->gram);
    m->rgb = malloc(B * (n + 2 * OUT) * sizeof *m->rgb);
    if (!m->gram || !m->rgb)
        return error_set(err, EX_OSERR, "out of memory (batch of %zu)", B);
    m->out = m->rgb + B * n;
    m->dout = m->out + B * OUT;
    fill_gram(m->gram, t->head, m->n);
    if (forgive_similarity(m->gram, t->head, m->n, err))
        return -1;
    if (shape_encoder_init(&m->net, &t->ps, "shape.", net, err) ||
        params_allocate(&t->ps, err) ||
        params_allocate_gradients(&t->ps, err))
        return -1;
    params_randomise(&t->ps, (uint64_t)c->seed);
    if (shape_encoder_plan(&m->net, B, opt, err))
        return -1;
    return judge_init(t, net, err);
}
