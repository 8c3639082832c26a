/* Golden 06: posing a synthetic FLAME-shaped head, forward and backward. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/head/lbs.h"
#include "tests/golden/flame_file.h"
#include "tests/golden/golden.h"

#define NV 5023
#define NSHAPE 300
#define NEXP 100
#define K (NSHAPE + NEXP)

/* Sparse joint regressor, skinning weights and correctives by the README's
 * formulas. */
static void make_regressor(float *J, uint64_t seed)
{
    for (int j = 0; j < 5; j++) {
        double w[12], sum = 0;

        for (int k = 0; k < 12; k++)
            sum += w[k] = 0.1 + golden_u("flame.J_weight", seed,
                                         (uint64_t)(12 * j + k));
        for (int k = 0; k < 12; k++) {
            double u = golden_u("flame.J_index", seed,
                                (uint64_t)(12 * j + k));
            int v = (j * 977 + k * 401 + (int)(400 * u)) % NV;

            J[j * NV + v] += (float)(w[k] / sum);
        }
    }
}

static void make_weights(float *w, uint64_t seed)
{
    for (int v = 0; v < NV; v++) {
        double raw[5], sum = 0;

        for (int j = 0; j < 5; j++) {
            raw[j] = golden_u("flame.lbs_weights", seed,
                              (uint64_t)(v * 5 + j)) - 0.5;
            if (raw[j] < 0)
                raw[j] = 0;
            if (j == v % 5)
                raw[j] += 0.05;
            sum += raw[j];
        }
        for (int j = 0; j < 5; j++)
            w[5 * v + j] = (float)(raw[j] / sum);
    }
}

static float *transpose_posedirs(const float *p)
{
    float *t = malloc((size_t)NV * 3 * 36 * sizeof *t);

    for (size_t k = 0; k < 36; k++)
        for (size_t i = 0; i < 3 * NV; i++)
            t[i * 36 + k] = p[k * 3 * NV + i];
    return t;
}

/* The case's head; with `imported` through FLAME's files. */
static void make_head(struct head *h, struct golden *g, bool imported)
{
    static const int32_t parents[5] = {-1, 0, 1, 1, 1}, face[3] = {0, 1, 2};
    float *template = golden_array("flame.v_template", g->seed, 3 * NV, 0, 0.1);
    float *dirs = golden_array("flame.shapedirs", g->seed, (size_t)3 * NV * K,
                               0, 0.002);
    float *posed = golden_array("flame.posedirs", g->seed, (size_t)36 * 3 * NV,
                                0, 0.002);
    float *l = golden_array("flame.l_eyelid", g->seed, 3 * NV, 0, 0.01);
    float *r = golden_array("flame.r_eyelid", g->seed, 3 * NV, 0, 0.01);
    float *J = calloc(5 * NV, sizeof *J), *w = calloc(5 * NV, sizeof *w);
    float *pt = transpose_posedirs(posed);
    struct head_arrays a = {
        .V = NV, .F = 1, .nshape = NSHAPE, .nexp = NEXP, .scale = 1,
        .v_template = template, .f = face, .shapedirs = dirs, .posedirs = pt,
        .J_regressor = J, .weights = w, .parents = parents,
        .l_eyelid = l, .r_eyelid = r, .lip_inner = face, .nlip_inner = 3,
        .lip_upper_outer = face, .nlip_upper_outer = 3
    };
    struct error err = {0};

    make_regressor(J, g->seed);
    make_weights(w, g->seed);
    if (imported ? flame_file_import(h, &a, &err) : head_init(h, &a, &err)) {
        fprintf(stderr, "golden: %s: %s\n", g->name, err.text);
        exit(1);
    }
    free(template);
    free(dirs);
    free(posed);
    free(l);
    free(r);
    free(J);
    free(w);
    free(pt);
}

static void flame_check(struct golden *g, const char *pose, const char *what,
                        const float *x, size_t n)
{
    char name[128];

    snprintf(name, sizeof name, "%s.%s", pose, what);
    golden_compare(g, name, x, n);
}

static void check_d(struct golden *g, const char *pose, const char *what,
                    const double *x, size_t n, double rel)
{
    char name[128];

    snprintf(name, sizeof name, "%s.%s", pose, what);
    golden_compare_f64(g, name, x, n, rel);
}

/* The float path: beta folded. */
static void run_float(struct golden *g, const char *pose, const float *angles,
                      const float *lid, const float *betas,
                      const struct identity *id)
{
    struct head_motion m = {.exp = betas + NSHAPE};
    float *verts = malloc(3 * NV * sizeof *verts), joints[15];
    float *probe = golden_probe_array(g->seed, 3 * NV);
    float *zero = calloc(3 * NV, sizeof *zero);

    memcpy(m.global, angles, sizeof m.global);
    memcpy(m.neck, angles + 3, sizeof m.neck);
    memcpy(m.jaw, angles + 6, sizeof m.jaw);
    memcpy(m.eye, angles + 9, sizeof m.eye);
    memcpy(m.lid, lid, sizeof m.lid);
    head_pose(verts, id, &m);
    head_pose_joints(joints, id, &m);
    flame_check(g, pose, "vertices", verts, 3 * NV);
    flame_check(g, pose, "joints", joints, 15);
    for (int of_joints = 0; of_joints < 2; of_joints++) {
        float db[K] = {0}, dp[15];
        struct head_motion_grad d = {.exp = db + NSHAPE, .beta = db};

        head_pose_backward(&d, of_joints ? zero : probe,
                           of_joints ? probe : NULL, id, &m);
        memcpy(dp, d.global, sizeof d.global);
        memcpy(dp + 3, d.neck, sizeof d.neck);
        memcpy(dp + 6, d.jaw, sizeof d.jaw);
        memcpy(dp + 9, d.eye, sizeof d.eye);
        flame_check(g, pose, of_joints ? "joint_grad_betas" : "grad_betas", db,
                    K);
        flame_check(g, pose, of_joints ? "joint_grad_pose" : "grad_pose", dp,
                    15);
        if (!of_joints)
            flame_check(g, pose, "grad_eyelid", d.lid, 2);
    }
    free(verts);
    free(probe);
    free(zero);
}

/* The double reference. */
static void run_double(struct golden *g, const char *pose,
                       const float *angles, const float *lid,
                       const float *betas, const struct head *h)
{
    double b[K], joints[15];
    double *verts = calloc(3 * NV, sizeof *verts);
    struct head_motion_d m = {.beta = b, .exp = b + NSHAPE,
                              .lid = {lid[0], lid[1]}};

    for (int i = 0; i < K; i++)
        b[i] = betas[i];
    for (int i = 0; i < 15; i++)
        m.pose[i] = angles[i];
    head_pose_d(verts, joints, h, &m);
    check_d(g, pose, "vertices", verts, 3 * NV, 1e-7);
    check_d(g, pose, "joints", joints, 15, 1e-7);
    free(verts);
}

/* Every pose P of the case: the tensors P.pose. */
static void run_poses(struct golden *g, bool imported)
{
    struct head h;
    struct identity id;
    struct error err = {0};
    float *betas = golden_array("input.betas", g->seed, K, 0, 1);

    make_head(&h, g, imported);
    h.public_rodrigues = 1;
    if (head_fold(&id, &h, betas, NSHAPE, &err))
        exit(1);
    for (size_t i = 0; i < st_count(g->st); i++) {
        const char *name = st_at(g->st, i)->name;
        size_t n = strlen(name);
        char pose[96], key[128];

        if (n < 6 || n > 90 || strcmp(name + n - 5, ".pose"))
            continue;
        snprintf(pose, sizeof pose, "%.*s", (int)(n - 5), name);
        snprintf(key, sizeof key, "%s.eyelid", pose);
        float *angles = golden_f32(g, name, NULL);
        float *lid = golden_f32(g, key, NULL);
        run_float(g, pose, angles, lid, betas, &id);
        run_double(g, pose, angles, lid, betas, &h);
        free(angles);
        free(lid);
    }
    identity_release(&id);
    head_release(&h);
    free(betas);
}

static void run_flame(struct golden *g)
{
    run_poses(g, false);
    printf("the same head from a pickle, imported:\n");
    run_poses(g, true);
}

GOLDEN_CASE("06_flame_lbs", run_flame)
