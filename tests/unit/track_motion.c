/* Tracking without a face to look at: what the encoder's numbers mean, the
 * landmarks' small head against the whole one, smoothing, a fixed crop.
 *     track_motion --model FILE
 * writes an untrained model for the pipe tests: encoders that see a frontal
 * face filling its crop, and the shipped refiner. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/net/config.h"
#include "lib/base/random.h"
#include "lib/base/rotation.h"
#include "lib/net/refiner.h"
#include "lib/net/shape_encoder.h"
#include "lib/track/oneeuro.h"
#include "lib/track/track.h"
#include "tests/check.h"
#include "tests/unit/random_head.h"

static double motion_orthonormal(const float R[9])
{
    double max = 0, det;

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double dot = 0;
            for (int k = 0; k < 3; k++)
                dot += (double)R[3 * i + k] * R[3 * j + k];
            max = fmax(max, fabs(dot - (i == j)));
        }
    det = R[0] * (R[4] * R[8] - R[5] * R[7])
        - R[1] * (R[3] * R[8] - R[5] * R[6])
        + R[2] * (R[3] * R[7] - R[4] * R[6]);
    max = fmax(max, fabs(det - 1));
    return isfinite(max) ? max : 1e9;
}

static void test_rotation(void)
{
    const struct square crop = {256, 256, 288};
    const float hard[][6] = {
        {0, 0, 0, 0, 0, 0}, {1, 0, 0, 1, 0, 0}, {1, 2, 3, -2, -4, -6},
        {0, 1, 0, 0, -1, 0}, {1e-20f, 0, 0, 0, 1e-20f, 0},
        {1e-7f, 0, 0, 0, -1e-7f, 0}, {1e18f, 0, 0, 0, 1e18f, 0},
        {1, 1, 1, 1, 1, 1.0001f}, {NAN, 0, 0, 0, INFINITY, 0},
        {0, 0, 1, 0, 0, 1e-3f}
    };
    struct random r;
    struct motion m;
    float out[MOTION_OUT] = {0}, want[9];
    double max = 0, same = 0;

    out[MOTION_TRANS + 2] = 7;
    for (size_t i = 0; i < sizeof hard / sizeof *hard; i++) {
        memcpy(out, hard[i], sizeof hard[i]);
        track_decode(&m, out, crop, 512);
        max = fmax(max, motion_orthonormal(m.R));
    }
    check("6D: hard cases are rotations", max, 1e-6);
    max = 0;
    random_init(&r, 11, "track rotation");
    for (int i = 0; i < 20000; i++) {
        double scale = exp(random_range(&r, -12, 12));
        for (int k = 0; k < 6; k++)
            out[k] = (float)(scale * random_normal(&r));
        if (i % 3 == 0)
            for (int k = 0; k < 3; k++)
                out[3 + k] = out[k] * (1 + (float)random_normal(&r) * 1e-3f);
        track_decode(&m, out, crop, 512);
        max = fmax(max, motion_orthonormal(m.R));
        if (i % 3 == 0)
            continue;
        rotation_6d(want, out);
        for (int k = 0; k < 9; k++)
            same = fmax(same, fabs(m.R[k] - want[k]));
    }
    check("6D: random ones, a third nearly parallel, are rotations", max,
          1e-6);
    check("6D: ordinary ones are Gram-Schmidt", same, 0);
}

static void test_oneeuro(void)
{
    struct oneeuro f;
    const float beta[1] = {1};
    double rest = 0, late = 0;
    struct random r;

    random_init(&r, 2, "one euro");
    oneeuro_init(&f, 1.5);
    for (int i = 0; i < 600; i++) {
        float x = 0.01f * (float)random_normal(&r);
        oneeuro_step(&f, &x, beta, 1, i / 30.0);
        if (i > 60)
            rest += (double)x * x;
    }
    check("one-euro: jitter of 0.01 at rest becomes", sqrt(rest / 539),
          0.006);
    oneeuro_init(&f, 1.5);
    for (int i = 0; i < 60; i++) {
        float t = (float)i / 30, x = 3 * t;
        oneeuro_step(&f, &x, beta, 1, t);
        if (i == 59)
            late = fabs((double)x - 3 * t) / 3;
    }
    check("one-euro: seconds behind a ramp of 3 a second", late, 0.05);
    oneeuro_init(&f, 0);
    {
        float x = 1;
        oneeuro_step(&f, &x, beta, 1, 0);
        x = 2;
        oneeuro_step(&f, &x, beta, 1, 1);
        check("one-euro: off means unchanged", fabs(x - 2.0), 0);
    }
}

/* A head of random vertices in two clouds and triangles between them. */
static void make_head(struct head *h)
{
    enum { V = 300, F = 200, NS = 4, NE = 100 };
    static const int32_t parents[5] = {-1, 0, 1, 1, 1};
    static int32_t f[3 * F], lip[4] = {1, 2, 3, 4}, faces[68];
    static float w[5 * V], J[5 * V], bary[68 * 3];
    struct random r;
    struct head_arrays a = {
        .V = V, .F = F, .nshape = NS, .nexp = NE, .f = f, .weights = w,
        .J_regressor = J, .parents = parents, .lip_inner = lip,
        .nlip_inner = 4, .lip_upper_outer = lip, .nlip_upper_outer = 4,
        .landmark_faces = faces, .landmark_bary = bary
    };

    random_init(&r, 4, "track head");
    a.v_template = random_numbers(&r, 3 * V, 0.1);
    a.shapedirs = random_numbers(&r, 3 * V * (NS + NE), 0.002);
    a.posedirs = random_numbers(&r, 3 * V * 36, 0.002);
    a.l_eyelid = random_numbers(&r, 3 * V, 0.002);
    a.r_eyelid = random_numbers(&r, 3 * V, 0.002);
    for (size_t i = 0; i < 3 * F; i++)
        f[i] = (int32_t)random_below(&r, V);
    for (size_t v = 0; v < V; v++) {
        w[5 * v + v % 5] = 0.75f;
        w[5 * v + (v + 1) % 5] = 0.25f;
    }
    for (size_t j = 0; j < 5; j++)
        J[j * V + 17 * j] = 1;
    for (int i = 0; i < 68; i++) {
        faces[i] = (int32_t)random_below(&r, F);
        bary[3 * i] = 0.5f;
        bary[3 * i + 1] = bary[3 * i + 2] = 0.25f;
    }
    random_head_init(h, &a);
}

static void test_landmarks(const struct head *h)
{
    const float beta[4] = {1, -2, 0.5f, 1};
    float *verts = malloc(3 * h->V * sizeof *verts), exp[100];
    float want[3 * 68], got[3 * 68];
    struct head_motion m = {.exp = exp, .jaw = {0.3f, 0.1f, 0},
                            .eye = {0.1f, 0, 0.2f, 0, 0.1f, 0},
                            .lid = {0.3f, 0.9f}};
    struct identity id;
    struct landmarks l;
    struct random r;
    struct error err = {0};
    double max = 0;

    random_init(&r, 8, "track landmarks");
    for (int i = 0; i < 100; i++)
        exp[i] = i % 3 ? (float)random_normal(&r) : 0;
    if (head_fold(&id, h, beta, 4, &err) || landmarks_init(&l, &id, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    head_pose(verts, &id, &m);
    head_landmarks(want, h, verts);
    landmarks_pose(got, &l, &m);
    for (int i = 0; i < 3 * 68; i++)
        max = fmax(max, fabs(want[i] - got[i]));
    check("landmarks of the small head are those of the whole", max, 1e-6);
    landmarks_release(&l);
    identity_release(&id);
    free(verts);
}

static void make_encoder(struct params *ps, struct motion_encoder *net)
{
    struct error err = {0};

    params_init(ps);
    if (motion_encoder_init(net, ps, "motion.", "mobilenetv3_small_100",
                            &err) || params_allocate(ps, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    params_randomise(ps, 1);
    motion_encoder_init_weights(net);
    if (motion_encoder_plan(net, 1, (struct nn_options){NN_INFER, NN_F32},
                            &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
}

/* With --crop the crop stays, its motion lands in it, and a huge picture is
 * shrunk to the same motion as a small one. */
static void test_fixed_crop(const struct head *h)
{
    struct params ps;
    struct motion_encoder net = {0};
    struct identity id;
    struct track t;
    struct track_result a, b;
    struct error err = {0};
    size_t W = 2400, H = 1800, k = 6, w = W / k, v = H / k;
    uint8_t *big = malloc(3 * W * H), *small = malloc(3 * w * v);
    const struct frame large = {.width = W, .height = H, .rgb = big};
    const struct frame reduced = {.width = w, .height = v, .rgb = small};
    struct track_options opt = {.size = 512, .has_crop = true,
                                .crop = {1200, 900, 1200}};
    float uv[2 * 68];
    float *seen = malloc(3 * CROP_NET * CROP_NET * sizeof *seen);
    double far = 0, differ = 0;

    make_encoder(&ps, &net);
    for (size_t y = 0; y < H; y++)
        for (size_t x = 0; x < W; x++)
            for (size_t c = 0; c < 3; c++)
                big[3 * (y * W + x) + c] = small[3 * (y / k * w + x / k) + c]
                    = (uint8_t)(128 + 100 * sin((double)(x / k) / 9 + (double)
                                                c) * cos((double)(y / k)
                                                         / 14));
    if (head_fold(&id, h, NULL, 0, &err)
        || track_init(&t, &id, &net, &opt, &err)
        || track_start(&t, &a, &large, NULL, &err) != 1
        || track_step(&t, &a, &large, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    track_project(uv, &t, &a.motion);
    for (int i = 0; i < 2 * 68; i++)
        far = fmax(far, fabs(uv[i] - a.motion.crop[i & 1])
                        / a.motion.crop[2]);
    check("landmarks lie in the crop, in sides from its middle", far, 1);
    check("the crop stays", fabs(a.motion.crop[2] * t.window.size / 512
                                 - 1200), 1e-2);
    memcpy(seen, t.input, 3 * CROP_NET * CROP_NET * sizeof *seen);
    track_release(&t);
    opt.crop = (struct square){200, 150, 200};
    if (track_init(&t, &id, &net, &opt, &err)
        || track_start(&t, &b, &reduced, NULL, &err) != 1)
        exit(1);
    for (size_t i = 0; i < 3 * CROP_NET * CROP_NET; i++)
        differ = fmax(differ, fabs(seen[i] - t.input[i]));
    check("a picture six times as large gives the same crop", differ, 0.05);
    free(seen);
    track_release(&t);
    identity_release(&id);
    motion_encoder_release(&net);
    params_release(&ps);
    free(big);
    free(small);
}

/* Layers that start at zero would hide what the tests look for. */
static void fill_zero_layers(struct params *ps)
{
    for (size_t i = 0; i < ps->count; i++) {
        struct random r;
        if (strncmp(ps->tensor[i].name, "refine.", 7) != 0
            || ps->tensor[i].init != PARAM_ZERO)
            continue;
        random_init(&r, 3, ps->tensor[i].name);
        for (size_t k = 0; k < ps->tensor[i].count; k++)
            param_w(ps, i)[k] = (float)random_range(&r, -0.03, 0.03);
    }
}

static int write_model(const char *path)
{
    struct params ps;
    struct motion_encoder net = {0};
    struct shape_encoder shape = {0};
    struct refiner refiner = {0};
    struct avatar_config config;
    struct error err = {0};
    const char *meta[3] = {"spid", NULL, NULL};
    char *json;
    float *bias;

    avatar_config_shipped(&config);
    params_init(&ps);
    if (motion_encoder_init(&net, &ps, "motion.", config.motion_net, &err)
        || shape_encoder_init(&shape, &ps, "shape.", config.shape_net, &err)
        || refiner_init(&refiner, &ps, "refine.", &config.refiner, &err)
        || params_allocate(&ps, &err)) {
        printf("%s\n", err.text);
        return 1;
    }
    params_randomise(&ps, 1);
    motion_encoder_init_weights(&net);
    fill_zero_layers(&ps);
    bias = param_w(&ps, params_find(&ps, "motion.trans.bias"));
    bias[0] = 0;                       /* the built-in head's face, centred */
    bias[1] = -0.109f;
    bias[2] = 6.98f;
    json = avatar_config_print(&config);
    meta[1] = json;
    if (!json || params_save(&ps, path, meta, &err)) {
        printf("%s\n", err.text);
        return 1;
    }
    free(json);
    motion_encoder_release(&net);
    shape_encoder_release(&shape);
    refiner_release(&refiner);
    params_release(&ps);
    return 0;
}

int main(int argc, char **argv)
{
    struct head h;

    if (argc == 3 && strcmp(argv[1], "--model") == 0)
        return write_model(argv[2]);

    test_rotation();
    test_oneeuro();
    make_head(&h);
    test_landmarks(&h);
    test_fixed_crop(&h);
    head_release(&h);
    return check_status();
}
