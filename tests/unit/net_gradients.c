/* Whole networks: for every tensor, and for the input, the derivative of a
 * random linear loss along the gradient against a central difference.  The
 * forward is float, so the tolerance is a few per cent: this finds a wrong or
 * missing term in some tensor's gradient; the layers' own tests (nn_*.c) and
 * the golden cases hold the digits. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/net/backbone.h"
#include "lib/net/matte_net.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/plane_init.h"
#include "lib/net/refiner.h"
#include "lib/net/shape_encoder.h"
#include "tests/check.h"

struct subject {
    const char *name;
    void (*forward)(float *out, const float *in, void *net);
    void (*backward)(float *din, const float *dout, void *net);
    void *self;
    struct params *ps;
    size_t in, out;
    float lo, hi;                /* range of the input */
};

/* the refiner's */
static float turn[RELATIVE_POSE_SIZE] = { 0.8f, -0.5f, 0.3f, -0.2f, 0.6f,
                                         0.1f };
static float dturn[RELATIVE_POSE_SIZE];

static struct nn_plans plans;    /* of the network under test */

static double net_loss(const struct subject *n, const float *in, float *out,
                       const float *probe)
{
    double sum = 0;

    nn_plans_update(&plans, true);
    if (!strcmp(n->name, "refiner"))
        refiner_turn(n->self, turn);
    n->forward(out, in, n->self);
    for (size_t i = 0; i < n->out; i++)
        sum += (double)out[i] * (double)probe[i];
    return sum;
}

/* Central difference of the loss along g (count values at w). */
static void check_gradient(const struct subject *n, const char *what, float *w,
                           const float *g, size_t count, const float *in,
                           float *out, const float *probe, double step)
{
    double norm = 0, size = 0;

    for (size_t i = 0; i < count; i++) {
        norm += (double)g[i] * (double)g[i];
        size += (double)w[i] * (double)w[i];
    }
    norm = sqrt(norm);
    /* a bias under a batch norm has no gradient but rounding */
    if (norm < 1e-5)
        return;
    float *keep = malloc(count * sizeof *keep);
    memcpy(keep, w, count * sizeof *keep);
    double found = 0, error = 1;
    /* kinks and rounding ask for different steps: one of eight must do */
    for (int k = 0; k < 8 && error > 0.03; k++, step *= 0.25) {
        double eps = step * (sqrt(size) + 1e-2 * sqrt((double)count)), l[2];

        for (int s = 0; s < 2; s++) {
            for (size_t i = 0; i < count; i++)
                w[i] = keep[i] + (float)((s ? -eps : eps) * (double)g[i] /
                                         norm);
            l[s] = net_loss(n, in, out, probe);
        }
        found = (l[0] - l[1]) / (2 * eps);
        error = fabs(found - norm) / norm;
    }
    memcpy(w, keep, count * sizeof *keep);
    free(keep);
    CHECK(error <= 0.03, "%s %s: difference %.6g, gradient %.6g", n->name,
          what, found, norm);
}

static void net_run(const struct subject *n)
{
    struct random r;
    struct params *ps = n->ps;
    float *in = malloc(n->in * sizeof *in), *din = malloc(n->in * sizeof *in);
    float *out = malloc(n->out * sizeof *out);
    float *probe = malloc(n->out * sizeof *probe);

    random_init(&r, 7, n->name);
    for (size_t i = 0; i < n->in; i++)
        in[i] = (float)random_range(&r, (double)n->lo, (double)n->hi);
    for (size_t i = 0; i < n->out; i++)
        probe[i] = (float)random_normal(&r);
    /* zero-initialised tensors would hide what lies before them */
    for (size_t t = 0; t < ps->count; t++)
        for (size_t i = 0; i < ps->tensor[t].count; i++)
            if (!ps->tensor[t].frozen && param_w(ps, t)[i] == 0)
                param_w(ps, t)[i] = 0.05f * (float)random_normal(&r);
    net_loss(n, in, out, probe);
    memset(ps->g, 0, ps->total * sizeof *ps->g);
    memcpy(out, probe, n->out * sizeof *out);
    n->backward(din, out, n->self);
    for (size_t t = 0; t < ps->count; t++)
        if (!ps->tensor[t].frozen)
            check_gradient(n, ps->tensor[t].name, param_w(ps, t),
                           param_g(ps, t), ps->tensor[t].count, in, out,
                           probe, 0.02);
    if (n->lo < n->hi && strcmp(n->name, "backbone") &&
        strcmp(n->name, "matte_net"))
        check_gradient(n, "input", in, din, n->in, in, out, probe, 0.02);
    if (!strcmp(n->name, "refiner"))
        check_gradient(n, "turn", turn, dturn, RELATIVE_POSE_SIZE, in,
                       out, probe, 0.02);
    printf("%s: %zu tensors compared\n", n->name, ps->count);
    free(in);
    free(din);
    free(out);
    free(probe);
}

#define ADAPT(net)                                                           \
    static void net##_fwd(float *out, const float *in, void *s)              \
    {                                                                        \
        net##_forward(out, in, s);                                           \
    }

ADAPT(backbone)
ADAPT(refiner)
ADAPT(plane_init)
ADAPT(motion_encoder)
ADAPT(shape_encoder)
ADAPT(matte_net)

static void matte_net_bwd(float *din, const float *dout, void *s)
{
    (void)din;
    matte_net_backward(dout, s);
}

static void backbone_bwd(float *din, const float *dout, void *s)
{
    (void)din;
    backbone_backward(dout, s);
}

static void refiner_bwd(float *din, const float *dout, void *s)
{
    refiner_backward(&(struct refiner_gradients){.feat = din, .turn = dturn},
                     dout, NULL, s);
}

static void plane_init_bwd(float *din, const float *dout, void *s)
{
    plane_init_backward(din, dout, s);
}

static void motion_encoder_bwd(float *din, const float *dout, void *s)
{
    motion_encoder_backward(din, dout, s);
}

static void shape_encoder_bwd(float *din, const float *dout, void *s)
{
    shape_encoder_backward(din, dout, s);
}

static const struct nn_options train = { NN_TRAIN, NN_F32 };
static struct error err;

static void net_ready(struct params *ps, int rc)
{
    if (rc || params_allocate(ps, &err) ||
        params_allocate_gradients(ps, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    params_randomise(ps, 3);
}

#define RUN(net, lo_, hi_, in_, out_)                                        \
    do {                                                                     \
        struct subject n = { #net, net##_fwd, net##_bwd, &net,               \
                             &ps, in_, out_, lo_, hi_ };                     \
        net_run(&n);                                                           \
        net##_release(&net);                                                 \
        nn_plans_release(&plans);                                            \
        params_release(&ps);                                                 \
    } while (0)

static void net_planned(int rc)
{
    if (rc) {
        printf("%s\n", err.text);
        exit(1);
    }
}

static void small_nets(void)
{
    struct params ps;
    struct backbone backbone;
    struct backbone_config bc = { .type = BACKBONE_SMALL, .features = 8,
                                  .size = 20, .width = 4 };

    params_init(&ps);
    net_ready(&ps, backbone_init(&backbone, &ps, "b.", &bc, &err));
    net_planned(backbone_plan(&backbone, 2, 32, train, &err));
    RUN(backbone, 0, 1, 2 * 32 * 32 * 3, 2 * 20 * 20 * 8);

    struct matte_net matte_net;
    params_init(&ps);
    matte_net_init(&matte_net, &ps, "m.", 64, 4);
    net_ready(&ps, 0);
    net_planned(matte_net_plan(&matte_net, 2, train, &err));
    RUN(matte_net, 0, 1, 2 * 64 * 64 * 3, 2 * 64 * 64);

    struct refiner refiner;
    struct refiner_config rc = { .type = REFINER_NARROW, .channels = 12,
                                 .width = 16, .multiplier = 1,
                                 .turn = true };
    params_init(&ps);
    net_ready(&ps, refiner_init(&refiner, &ps, "r.", &rc, &err));
    net_planned(refiner_plan(&refiner, 2, 64, 32, train, &err));
    RUN(refiner, -1, 1, 2 * 64 * 32 * 12, 2 * 64 * 32 * 3);

    struct plane_init plane_init;
    params_init(&ps);
    plane_init_init(&plane_init, &ps, "p.", 9, 16);
    net_ready(&ps, 0);
    net_planned(plane_init_plan(&plane_init, 11, 13, train, &err));
    RUN(plane_init, -1, 1, 11 * 13 * 9, 11 * 13 * 2);
}

static void net_encoders(void)
{
    struct params ps;
    struct motion_encoder motion_encoder;
    struct shape_encoder shape_encoder;
    size_t in = 2 * 224 * 224 * 3;

    params_init(&ps);
    net_ready(&ps,
              motion_encoder_init(&motion_encoder, &ps, "m.",
                                  "tf_mobilenetv3_small_minimal_100", &err));
    net_planned(motion_encoder_plan(&motion_encoder, 2, train, &err));
    RUN(motion_encoder, 0, 1, in, 2 * MOTION_OUT);
    params_init(&ps);
    net_ready(&ps, shape_encoder_init(&shape_encoder, &ps, "s.",
                                      "mobilenetv3_small_100", &err));
    net_planned(shape_encoder_plan(&shape_encoder, 2, train, &err));
    RUN(shape_encoder, 0, 1, in, 2 * SHAPE_ENCODER_OUT);
}

/* A frozen transformer sees weights that come after it was planned. */
static void net_loaded(void)
{
    const struct backbone_config c = { .type = BACKBONE_DINOV2, .features = 8,
                                       .size = 20, .embed = 16, .depth = 4,
                                       .heads = 2, .patch = 14, .image = 56 };
    static float rgb[32 * 32 * 3], out[2][20 * 20 * 8];
    double worst = 0;

    for (size_t i = 0; i < 32 * 32 * 3; i++)
        rgb[i] = (float)(i % 97) / 97;
    for (int first = 0; first < 2; first++) {
        struct backbone b;
        struct params ps;

        params_init(&ps);
        net_ready(&ps, backbone_init(&b, &ps, "b.", &c, &err));
        if (first)
            params_randomise(&ps, 4);
        net_planned(backbone_plan(&b, 1, 32, train, &err));
        if (!first)
            params_randomise(&ps, 4);
        nn_plans_update(&plans, true);
        backbone_forward(out[first], rgb, &b);
        backbone_release(&b);
        nn_plans_release(&plans);
        params_release(&ps);
    }
    for (size_t i = 0; i < 20 * 20 * 8; i++)
        worst = fmax(worst, fabs((double)out[0][i] - (double)out[1][i]));
    check("weights before and after planning", worst, 0);
}

int main(void)
{
    nn_plans_use(&plans);
    net_loaded();
    small_nets();
    net_encoders();
    printf("%d gradients differ\n", check_failures);
    return check_status();
}
