/* Test-time augmentation: each encoder runs on several versions of a crop,
 * and the outputs, mirrored back where the crop was, are averaged. */
#include "lib/track/tta.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/form.h"

#define N SHAPE_ENCODER_SIZE

/* The length of a change of E_m's expression, jaw and rotation (6D) from which
 * on the mirror image is looked at anew: 17 degrees, or a third of one of
 * ARKit's movements. */
#define MOVED 0.3

/* Where the crop is moved to and how much larger it is made, of its side:
 * what a tracker's crops differ by, the same to the left and to the right. */
static const struct square view[] = {
    {0.02, 0.01, 1}, {-0.02, 0.01, 1}, {0, -0.02, 1.03}, {0, 0, 0.97}};
#define VIEWS (sizeof view / sizeof *view)

int shape_tta_init(struct shape_tta *t, struct shape_encoder *net,
               const struct head *h, struct error *err)
{
    memset(t, 0, sizeof *t);
    t->net = net;
    t->rgb = malloc(3 * N * N * sizeof *t->rgb);
    if (!t->rgb)
        return error_set(err, EX_OSERR, "no memory for a face crop");
    if (h->nshape > SHAPE_ENCODER_OUT)
        return 0;
    int rc = head_mirror_shape(&t->across, h, err);
    t->mirror = rc > 0;
    return rc < 0 ? -1 : 0;
}

void shape_tta_release(struct shape_tta *t)
{
    free(t->rgb);
    t->rgb = NULL;
}

void tta_mirror_picture(float *out, const float *rgb, size_t n)
{
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < (n + 1) / 2; x++) {
            size_t a = 3 * (y * n + x), b = 3 * (y * n + n - 1 - x);
            float left[3], right[3];

            memcpy(left, rgb + a, sizeof left);
            memcpy(right, rgb + b, sizeof right);
            memcpy(out + a, right, sizeof left);
            memcpy(out + b, left, sizeof right);
        }
}

/* sum += what the network says of t->rgb, or of its mirror image. */
static void shape_tta_add(float *sum, struct shape_tta *t, bool mirrored)
{
    float said[SHAPE_ENCODER_OUT], beta[SHAPE_ENCODER_OUT];

    shape_encoder_forward(said, t->rgb, t->net);
    memcpy(beta, said, sizeof beta);
    if (mirrored)
        head_mirror_apply(beta, said, &t->across);
    for (size_t k = 0; k < SHAPE_ENCODER_OUT; k++)
        sum[k] += beta[k];
}

int shape_tta_forward(float *beta, struct shape_tta *t, struct square q,
                      tta_crop_fn *crop, void *ctx, struct error *err)
{
    memset(beta, 0, SHAPE_ENCODER_OUT * sizeof *beta);
    for (size_t i = 0; i < VIEWS; i++) {
        struct square moved = {q.x + view[i].x * q.size,
                               q.y + view[i].y * q.size,
                               view[i].size * q.size};

        if (crop(ctx, t->rgb, moved, err))
            return -1;
        shape_tta_add(beta, t, false);
        if (!t->mirror)
            continue;
        tta_mirror_picture(t->rgb, t->rgb, N);
        shape_tta_add(beta, t, true);
    }
    for (size_t k = 0; k < SHAPE_ENCODER_OUT; k++)
        beta[k] /= (float)(VIEWS * (t->mirror ? 2 : 1));
    return 0;
}

int light_of_crop(struct motion *m, const struct light_net *net,
                  struct square q, tta_crop_fn *crop, void *ctx,
                  struct error *err)
{
    const size_t n = LIGHT_NET_SIDE;
    float *rgb = malloc(3 * n * n * sizeof *rgb);
    int rc = rgb ? crop(ctx, rgb, q, err)
                 : error_set(err, EX_OSERR, "no memory for a crop");

    if (rc == 0)
        light_net_forward(m->light, rgb, net);
    m->lit = rc == 0 && net->hidden.ps;
    free(rgb);
    return rc;
}

/* Rotations and axis-angles of the mirrored person: M R M with
 * M = diag(-1,1,1); translations are mirrored by M, eyes and lids change
 * sides. */
int motion_mirror_init(struct motion_mirror *m, const struct head *h,
                       struct error *err)
{
    static const float rot[6] = {1, -1, -1, -1, 1, 1};
    static const float axis[3] = {1, -1, -1};
    struct head_mirror e;
    int rc =
        h->nexp <= MOTION_JAW - MOTION_EXP ? head_mirror_exp(&e, h, err) : 0;

    if (rc <= 0)
        return rc;
    for (int k = 0; k < MOTION_OUT; k++) {
        m->from[k] = k;
        m->sign[k] = 1;
    }
    memcpy(m->sign + MOTION_ROT, rot, sizeof rot);
    m->sign[MOTION_TRANS] = -1;
    for (size_t k = 0; k < e.n; k++) {
        m->from[(size_t)MOTION_EXP + k] = MOTION_EXP + e.from[k];
        m->sign[(size_t)MOTION_EXP + k] = e.sign[k];
    }
    for (int k = 0; k < 3; k++)
        m->sign[MOTION_JAW + k] = axis[k];
    for (int k = 0; k < 2; k++)
        m->from[MOTION_LID + k] = MOTION_LID + 1 - k;
    for (int k = 0; k < 6; k++) {
        m->from[MOTION_EYE + k] = MOTION_EYE + (k + 3) % 6;
        m->sign[MOTION_EYE + k] = axis[k % 3];
    }
    m->known = true;
    return 1;
}

void motion_mirror_mean(float *out, const float *mirrored,
                        const struct motion_mirror *m)
{
    for (int k = 0; k < MOTION_OUT; k++)
        out[k] = 0.5f * (out[k] + m->sign[k] * mirrored[m->from[k]]);
}

/* Plan net for `batch` crops and the type that is wanted, if it is not yet: where
 * there is no bfloat16 to be quicker by, a photograph's plan serves its driver. */
static int motion_tta_plan(struct motion_encoder *net, size_t batch,
                           bool quick, struct error *err)
{
    const struct form_rates r = form_rates();
    struct nn_options opt = net->plan.opt;

    if (net->quick || (opt.mode == NN_INFER && opt.type == NN_FAST)) {
        net->quick = quick && r.bf16 > r.f32;
        opt.type = net->quick ? NN_BF16 : NN_FAST;
    }
    return net->batch == batch && net->plan.opt.type == opt.type
               ? 0 : motion_encoder_plan(net, batch, opt, err);
}

int motion_tta_init(struct motion_tta *t, struct motion_encoder *net,
                    size_t batch, const struct head *h, bool wanted,
                    struct motion_mirror *shared, bool quick,
                    struct error *err)
{
    memset(t, 0, sizeof *t);
    t->net = net;
    t->batch = batch;
    if (wanted && shared)
        t->across = *shared;
    if (wanted && !t->across.known &&
        motion_mirror_init(&t->across, h, err) < 0)
        return -1;
    if (shared && t->across.known)
        *shared = t->across;
    size_t both = t->across.known ? 2 * batch : batch;
    if (motion_tta_plan(net, both, quick, err))
        return -1;
    if (!t->across.known)
        return 0;
    t->rgb = malloc(both * (3 * N * N + MOTION_OUT) * sizeof *t->rgb);
    if (!t->rgb)
        return error_set(err, EX_OSERR, "no memory for %zu face crops", both);
    t->raw = t->rgb + both * 3 * N * N;
    return 0;
}

void motion_tta_release(struct motion_tta *t)
{
    free(t->rgb);
    t->rgb = NULL;
}

/* What the mirror image adds to E_m's output for the picture, of crop 0. */
static void motion_tta_compare(struct motion_tta *t)
{
    memcpy(t->own, t->raw, sizeof t->own);
    memcpy(t->added, t->raw, sizeof t->added);
    motion_mirror_mean(t->added, t->raw + t->batch * MOTION_OUT, &t->across);
    for (int k = 0; k < MOTION_OUT; k++)
        t->added[k] -= t->own[k];
    t->compared = t->looked = true;
}

void motion_tta_forward(float *out, struct motion_tta *t, const float *rgb)
{
    const size_t B = t->batch, crop = 3 * N * N;

    if (!t->across.known) {
        motion_encoder_forward(out, rgb, t->net);
        return;
    }
    memcpy(t->rgb, rgb, B * crop * sizeof *rgb);
    for (size_t i = 0; i < B; i++)
        tta_mirror_picture(t->rgb + (B + i) * crop, rgb + i * crop, N);
    motion_encoder_forward(t->raw, t->rgb, t->net);
    memcpy(out, t->raw, B * MOTION_OUT * sizeof *out);
    for (size_t i = 0; i < B; i++)
        motion_mirror_mean(out + i * MOTION_OUT, t->raw + (B + i) * MOTION_OUT,
                           &t->across);
    motion_tta_compare(t);
}

/* Whether the face has turned or changed since its mirror image was looked at. */
static bool motion_tta_moved(const struct motion_tta *t)
{
    double square = 0;

    for (int k = 0; k < MOTION_LID; k++) {
        const double d = (double)t->raw[k] - (double)t->own[k];

        square += k < MOTION_TRANS || k >= MOTION_EXP ? d * d : 0;
    }
    return !(square < MOVED * MOVED);
}

void motion_tta_follow(float *out, struct motion_tta *t, const float *rgb)
{
    if (!t->compared) {
        motion_tta_forward(out, t, rgb);
        return;
    }
    motion_encoder_forward_one(t->raw, rgb, 0, t->net);
    t->looked = motion_tta_moved(t);
    if (t->looked) {
        tta_mirror_picture(t->rgb, rgb, N);
        motion_encoder_forward_one(t->raw + MOTION_OUT, t->rgb, 1, t->net);
        motion_tta_compare(t);
    }
    for (int k = 0; k < MOTION_OUT; k++)
        out[k] = t->raw[k] + t->added[k];
    for (int k = MOTION_LID; k < MOTION_LID + 2; k++)
        out[k] = fminf(fmaxf(out[k], 0), 1);
}

float motion_tta_confidence(const struct motion_tta *t)
{
    float confidence = motion_encoder_confidence(t->net, 0);

    return t->looked ? 0.5f * (confidence +
                               motion_encoder_confidence(t->net, t->batch))
                     : confidence;
}
