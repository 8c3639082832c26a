/* The whole avatar on a small configuration: geometry against a double
 * reference written again here, and the gradient of a random linear function
 * of all Gaussians' numbers against central differences, by weight tensor and
 * by driven vertex. */
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/avatar.h"
#include "lib/avatar/material.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs.h"
#include "lib/lab/head/avatar_make.h"
#include "tests/check.h"
#include "tests/reference/rotation.h"
#include "tests/unit/shipped_mouth.h"
#include "tests/unit/sphere_head.h"

static struct nn_plans plans;

#define S 64

struct world {
    struct head head;
    struct params ps;
    struct avatar a;
    struct identity id;
    float *verts, *driven, *rest;
    uint8_t rgb[3 * S * S], matte[S * S];
    float cam[12], frame[12];   /* the source's and the frame's */
    float *probe;           /* for every number of the set, fixed */
    float *means;           /* of the driven frame */
};

static void gradient_configure(struct avatar_config *c, bool skip)
{
    avatar_config_shipped(c);
    c->size = S;
    c->plane = 24;
    c->mouth = 16;
    c->channels = 5;
    c->feature = 8;
    c->backbone.features = 8;
    c->backbone.size = 24;
    c->backbone.width = 4;
    c->init_width = 4;
    c->static_width = 8;
    c->dynamic_width = 8;
    c->dynamic_hidden = 8;
    c->vertex_width = 4;
    c->mouth_width = 8;
    c->rgb_skip = skip;
    c->has_refiner = false;
}

static void gradient_make(struct world *w, bool skip, unsigned without)
{
    struct avatar_config c;
    struct error err = {0};
    struct random r;
    float beta[2] = {0.5f, -1}, turn[3] = {0.1f, 0.4f, 0.05f}, R[9];
    const float t[3] = {0.05f, -0.02f, 12}, F[9] = {1, 0, 0, 0, -1, 0,
                                                    0, 0, -1};
    float exp[SPHERE_EXP] = {0.3f, -0.5f};
    struct head_motion m = {.jaw = {0.1f}}, d = {.exp = exp, .jaw = {0.3f}};

    memset(w, 0, sizeof *w);
    random_init(&r, 3, "avatar_gradient");
    sphere_head(&w->head, 9, 14);
    gradient_configure(&c, skip);
    params_init(&w->ps);
    if (avatar_make(&w->head, shipped_mouth(), &err) ||
        avatar_init(&w->a, &w->ps, &c, &w->head, &err) ||
        params_allocate(&w->ps, &err) ||
        params_allocate_gradients(&w->ps, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    params_randomise(&w->ps, 7);
    avatar_init_weights(&w->a);
    /* the last layer of Phi_init starts at zero: move the plane a little */
    for (size_t i = 0; i < w->ps.count; i++)
        for (size_t k = 0; strncmp(w->ps.tensor[i].name, "init.4", 6) == 0 &&
             k < w->ps.tensor[i].count; k++)
            param_w(&w->ps, i)[k] = (float)random_range(&r, -0.2, 0.2);
    w->a.without = without;
    if (avatar_plan(&w->a, (struct nn_options){NN_FROZEN, NN_F32}, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    size_t V = w->head.V;
    w->verts = calloc(3 * V, sizeof(float));
    w->driven = calloc(3 * V, sizeof(float));
    head_fold(&w->id, &w->head, beta, 2, &err);
    head_pose(w->verts, &w->id, &m);
    w->rest = calloc(3 * V, sizeof(float));
    identity_rest(w->rest, &w->id);
    head_pose(w->driven, &w->id, &d);
    for (size_t i = 0; i < w->head.nlip_inner; i++)     /* the source's lips
                                                         * are open */
        w->verts[3 * w->head.lip_inner[i] + 1] += i % 2 ? -0.06f : 0.06f;
    rotation_exp(R, turn);
    float Q[9];
    mat3_mul(Q, F, R);
    camera_make(w->cam, Q, t);
    rotation_exp(R, (const float[3]){-0.2f, 0.3f, 0.1f});
    mat3_mul(Q, F, R);
    camera_make(w->frame, Q, t);
    /* a sphere has no neck: blend its lower half */
    w->head.avatar.neck_blend[3] = 0.2f;
    for (size_t i = 0; i < V + w->a.dense.E; i++)
        w->head.avatar.neck[i] = (float)random_range(&r, 0, 1);
    for (size_t i = 0; i < 3 * S * S; i++) {    /* smooth, so that steps of
                                                 * the plane see a slope */
        size_t x = i / 3 % S, y = i / 3 / S;
        w->rgb[i] = (uint8_t)(128 + 90 * sin(0.11 * (double)(x + i % 3 * 2)) *
                              cos(0.07 * (double)y));
    }
    memset(w->matte, 255, sizeof w->matte);
    w->probe = malloc(64 * 4096 * sizeof(float));
    for (size_t i = 0; i < 64 * 4096; i++)
        w->probe[i] = (float)random_range(&r, -1, 1);
    w->means = malloc(3 * 4096 * sizeof(float));
}

static void gradient_release(struct world *w)
{
    avatar_release(&w->a);
    nn_plans_release(&plans);
    params_release(&w->ps);
    identity_release(&w->id);
    head_release(&w->head);
    free(w->verts);
    free(w->driven);
    free(w->rest);
    free(w->probe);
    free(w->means);
}

/* sum probe . (means of the driven frame, scale, quat, opacity, colour). */
static double gradient_loss(struct world *w)
{
    struct avatar_source src = {
        .rgb = w->rgb, .matte = w->matte, .verts = w->verts, .cam = w->cam,
        .rest = w->rest
    };
    double sum = 0;
    const float *p = w->probe;

    nn_plans_update(&plans, true);
    avatar_bake(&w->a, &src);
    avatar_drive(w->means, &w->a, w->driven, w->frame);
    const struct gaussians *g = &w->a.set;
    const float *part[5] = {w->means, g->scale, g->quat, g->opacity,
                            g->color};
    size_t width[5] = {3, 3, 4, 1, (size_t)g->channels};
    /* scales are 0.05 at most: weigh them up */
    static const double factor[5] = {1, 20, 1, 1, 1};
    for (int k = 0; k < 5; k++)
        for (size_t i = 0; i < g->n * width[k]; i++)
            sum += factor[k] * (double)*p++ * part[k][i];
    return sum;
}

static void gradient_backward(struct world *w, float *dverts, float dcam[12])
{
    struct splat_gradients d = avatar_gradients(&w->a);
    size_t n = w->a.set.n, C = (size_t)w->a.set.channels;
    const float *p = w->probe;

    for (size_t i = 0; i < 3 * n; i++)
        d.mean[i] = *p++;
    for (size_t i = 0; i < 3 * n; i++)
        d.scale[i] = 20 * *p++;
    for (size_t i = 0; i < 4 * n; i++)
        d.quat[i] = *p++;
    for (size_t i = 0; i < n; i++)
        d.opacity[i] = *p++;
    for (size_t i = 0; i < C * n; i++)
        d.color[i] = *p++;
    avatar_drive_backward(dverts, dcam, &w->a);
    avatar_bake_backward(&w->a);
}

/* Differences of a group of tensors: up to how many steps to each side, how long, and
 * how far their slope may be from the gradient, relative. */
struct difference {
    int count;
    double step, limit;
};

/* A forward in float rounds the sum to some 1e-5.  What is deep has kinks of
 * relu and bilinear weights closer by than a step that rises above that: from
 * 2e-5 to 1e-3 its slopes scatter by 1 to 3 %, without bias, so that a line is laid
 * through several.  The vertices' own numbers have a small gradient and no kinks. */
static struct difference gradient_difference(const char *prefix)
{
    if (!strcmp(prefix, "dynamic.head_base"))
        return (struct difference){1, 1e-2, 1e-2};
    if (!strcmp(prefix, "backbone.") || !strcmp(prefix, "init."))
        return (struct difference){4, 1e-4, 1e-2};
    return (struct difference){1, 5e-4, 2e-3};
}

/* Along the gradient of one group of tensors, normalised: the derivative
 * must be its length. */
static void gradient_direction(struct world *w, const char *prefix)
{
    const struct difference difference = gradient_difference(prefix);
    double norm = 0, slope = 0, squares = 0;
    size_t total = w->ps.total;
    float *keep = malloc(total * sizeof *keep), *g = calloc(total, sizeof *g);

    memcpy(keep, w->ps.w, total * sizeof *keep);
    for (size_t i = 0; i < w->ps.count; i++)
        if (strncmp(w->ps.tensor[i].name, prefix, strlen(prefix)) == 0)
            memcpy(g + w->ps.tensor[i].offset, param_g(&w->ps, i),
                   w->ps.tensor[i].count * sizeof *g);
    for (size_t i = 0; i < total; i++)
        norm += (double)g[i] * g[i];
    norm = sqrt(norm);
    for (int k = -difference.count; k <= difference.count; k++) {
        const double h = k * difference.step;

        for (size_t i = 0; i < total; i++)
            w->ps.w[i] = keep[i] + (float)(h * g[i] / norm);
        slope += h * gradient_loss(w);
        squares += h * h;
    }
    slope /= squares;
    memcpy(w->ps.w, keep, total * sizeof *keep);
    char what[96];
    snprintf(what, sizeof what, "%s: |g| %.4g, slope along it %.4g", prefix,
             norm, slope);
    check(what, norm > 0 ? fabs(slope - norm) / norm : 1, difference.limit);
    free(keep);
    free(g);
}

/* Derivative of the probed means by *x, which they are linear in: differences
 * are exact. */
static double slope_at(struct world *w, float *x)
{
    const float keep = *x;
    double h = 0.25, value[2] = {0};

    for (int s = 0; s < 2; s++) {
        *x = keep + (float)(s ? -h : h);
        avatar_drive(w->means, &w->a, w->driven, w->frame);
        for (size_t k = 0; k < 3 * w->a.set.n; k++)
            value[s] += (double)w->probe[k] * w->means[k];
    }
    *x = keep;
    return (value[0] - value[1]) / (2 * h);
}

/* Largest difference of every step-th slope from g (n), over the largest g. */
static double worst_slope(struct world *w, float *x, const float *g, size_t n,
                          size_t step)
{
    double worst = 0, size = 1;

    for (size_t i = 0; i < n; i++)
        size = fmax(size, fabs(g[i]));
    for (size_t i = 0; i < n; i += step)
        worst = fmax(worst, fabs(slope_at(w, x + i) - g[i]) / size);
    return worst;
}

static void gradient_vertices(struct world *w, const float *dverts)
{
    check("driven vertices: gradient by differences",
          worst_slope(w, w->driven, dverts, 3 * w->head.V, 7), 1e-5);
}

/* The frame's rotation turns the shoulders; its translation nothing. */
static void gradient_camera(struct world *w, const float dcam[12])
{
    double max = 0;

    for (int i = 0; i < 12; i++)
        max = fmax(max, fabs(dcam[i]));
    check("camera: gradient of the neck blend by differences",
          worst_slope(w, w->frame, dcam, 12, 1), 1e-5);
    check("camera: it has one (0 or 1 missing)", max > 1 ? 0 : 1, 0.5);
}

/* x + w (B x - x), B = p + R_d^T from (x - p). */
static void gradient_blend(double x[3], const struct world *w, double weight,
                 const float *from, size_t row)
{
    const float *p = w->head.avatar.neck_blend;
    double a[3], y[3];

    for (size_t i = 0; i < 3; i++)
        a[i] = from[row * i] * (x[0] - p[0]) +
               from[row * i + 1] * (x[1] - p[1]) +
               from[row * i + 2] * (x[2] - p[2]);
    for (size_t j = 0; j < 3; j++)
        y[j] = p[j] + w->frame[j] * a[0] + w->frame[4 + j] * a[1] +
               w->frame[8 + j] * a[2];
    for (size_t j = 0; j < 3; j++)
        x[j] += weight * (y[j] - x[j]);
}

/* The lower teeth are turned and stretched in the yz plane about the hinge as
 * the chin is, with complex numbers; the upper ones by their small share. */
static void reference_teeth(struct world *w)
{
    const struct avatar *a = &w->a;
    const struct head *h = &w->head;
    const float *hinge = h->joint_template + 3 * JOINT_JAW;
    double complex from, to, rest;
    const double share = (double)w->head.avatar.mouth_jaw[0];
    double worst = 0, moved = 0;
    float cs[3], cd[3], cr[3];

    check("chin: vertices", w->head.nchin > 0 ? 0 : 1, 0);
    head_centroid(cs, h->chin, h->nchin, w->verts);
    head_centroid(cd, h->chin, h->nchin, w->driven);
    head_centroid(cr, h->chin, h->nchin, a->source.rest);
    rest = cr[2] - hinge[2] + I * (cr[1] - hinge[1]);
    from = cs[2] - hinge[2] + I * (cs[1] - hinge[1]);
    to = cd[2] - hinge[2] + I * (cd[1] - hinge[1]);
    for (size_t k = 0; k < a->mouth.count; k++) {
        const float *x = a->set.mean + 3 * (a->first[2] + k);
        const float *y = w->means + 3 * (a->first[2] + k);
        double complex p = x[2] - hinge[2] + I * (x[1] - hinge[1]);
        double complex q = y[2] - hinge[2] + I * (y[1] - hinge[1]);

        if (a->mouth.teeth[k].layer == MOUTH_UPPER)
            worst = fmax(worst, cabs(q - p - p * (to - from) * share /
                                     (rest + share * (from - rest))));
        if (a->mouth.teeth[k].layer == MOUTH_LOWER) {
            worst = fmax(worst, cabs(q - p * to / from));
            moved = fmax(moved, cabs(q - p));
        }
    }
    check("teeth: lower turn with the chin, upper hardly", worst, 1e-5);
    check("teeth: lower ones move", moved > 0.01 ? 0 : 1, 0);
}

/* Means of the driven frame, worked again in double from the equations. */
static void gradient_reference(struct world *w)
{
    const struct avatar *a = &w->a;
    const struct static_branch *s = &a->plane;
    size_t K = a->mouth.K;
    double worst = 0, ls[3] = {0}, ld[3] = {0};

    gradient_loss(w);
    for (size_t e = 0; w->head.V + e < a->first[1]; e++) {
        size_t k = w->head.V + e;
        double m[3];

        for (size_t c = 0; c < 3; c++)
            m[c] = 0.5 * (w->driven[3 * (size_t)a->dense.edge[2 * e] + c] +
                          w->driven[3 * (size_t)a->dense.edge[2 * e + 1] + c]);
        gradient_blend(m, w, a->drive.weight[k], neck_blend_upright, 3);
        for (size_t c = 0; c < 3; c++)
            worst = fmax(worst, fabs(m[c] - w->means[3 * k + c]));
    }
    check("dynamic: blended midpoints of driven vertices", worst, 2e-6);
    worst = 0;
    for (size_t k = 0; k < s->count && a->first[2] > a->first[1]; k++) {
        double rise = a->config.rgb_skip ? s->surface[k] : 0;
        double z = w->cam[11] - rise, mu[3];

        for (int c = 0; c < 3; c++) {
            double o = 0, ray = 0;

            for (int i = 0; i < 3; i++)
                o -= (double)w->cam[4 * i + c] * w->cam[4 * i + 3];
            ray = w->cam[c] * (double)s->U[2 * k] / 12 +
                  w->cam[4 + c] * (double)s->U[2 * k + 1] / 12 +
                  w->cam[8 + c];
            mu[c] = o + z * ray - (2.0 * s->p[k] - 1 - rise) * w->cam[8 + c];
        }
        gradient_blend(mu, w, a->drive.weight[a->first[1] + k], w->cam, 4);
        for (size_t c = 0; c < 3; c++)
            worst = fmax(worst, fabs(mu[c] -
                                     w->means[3 * (a->first[1] + k) + c]));
    }
    check("static: o_s + d_s r_k + (2p - 1) n_s, blended", worst, 1e-5);
    if (a->config.rgb_skip && a->first[3] > a->first[2]) {
        reference_teeth(w);
        return;
    }
    for (size_t i = 0; i < w->head.nlip_inner; i++)
        for (int c = 0; c < 3; c++) {
            ls[c] += w->verts[3 * w->head.lip_inner[i] + c] /
                     (double)w->head.nlip_inner;
            ld[c] += w->driven[3 * w->head.lip_inner[i] + c] /
                     (double)w->head.nlip_inner;
        }
    worst = 0;
    for (size_t k = 0; k < a->first[3] - a->first[2]; k++) {
        double uv[2] = {(double)(2 * (k % K) + 1) / (double)K - 1,
                        1 - (double)(2 * (k / K) + 1) / (double)K};

        for (int c = 0; c < 3; c++) {
            double q = a->mouth.q[3 * k + (size_t)c];

            if (c == 2)
                q = fmin(fmax(q, -a->mouth.cap), a->mouth.cap);
            double g = ls[c] + (c < 2 ? a->mouth.lips.radius * uv[c] : 0);
            worst = fmax(worst, fabs(g - ls[c] + ld[c] + q -
                                     w->means[3 * (a->first[2] + k) +
                                              (size_t)c]));
        }
    }
    check("mouth: g - l_s + l_d + q", worst, 1e-6);
}

static void gradient_run(bool skip, unsigned without)
{
    static const char *const groups[] = {"backbone.", "init.", "static.",
                                         "dynamic.", "dynamic.head_base",
                                         "mouth."};
    struct world w;

    printf("-- rgb_skip %d, without %u\n", skip, without);
    gradient_make(&w, skip, without);
    float *dverts = calloc(3 * w.head.V, sizeof *dverts), dcam[12] = {0};
    gradient_reference(&w);
    memset(w.ps.g, 0, w.ps.total * sizeof *w.ps.g);
    gradient_loss(&w);
    gradient_backward(&w, dverts, dcam);
    for (size_t i = 0; i < 6; i++) {
        if ((i == 1 && without & (WITHOUT_DEFORM | WITHOUT_STATIC)) ||
            (i == 2 && without & WITHOUT_STATIC) ||
            ((i == 3 || i == 4) && without & WITHOUT_DYNAMIC) ||
            (i == 5 && without & WITHOUT_MOUTH))
            continue;
        gradient_direction(&w, groups[i]);
    }
    gradient_vertices(&w, dverts);
    if (!(without & WITHOUT_NECK))
        gradient_camera(&w, dcam);
    free(dverts);
    gradient_release(&w);
}

/* Back from the loss just taken, along these groups (NULL ends them); w's
 * last use. */
static void gradient_follow(struct world *w, const char *const *group)
{
    float *dverts = calloc(3 * w->head.V, sizeof *dverts), dcam[12] = {0};

    gradient_backward(w, dverts, dcam);
    for (; *group; group++)
        gradient_direction(w, *group);
    free(dverts);
    gradient_release(w);
}

/* Every Gaussian of the mesh is a solid disk on it: its third axis is the normal, and
 * thin where it is skin; the decoder has no say in that. */
static void gradient_disks(void)
{
    struct world w;
    double off = 0, size = 0, clear = 0;

    printf("-- disks\n");
    gradient_make(&w, true, 0);
    memset(w.ps.g, 0, w.ps.total * sizeof *w.ps.g);
    gradient_loss(&w);

    const struct dynamic_branch *b = &w.a.dynamic;
    for (size_t k = 0; k < w.a.first[1]; k++) {
        const float *scale = w.a.set.scale + 3 * k, *n = b->normals + 3 * k;
        const float *quat = w.a.set.quat + 4 * k;
        const double len = hypot(hypot(n[0], n[1]), n[2]);
        const double hair = b->chance[MATERIAL_HAIR * b->count + k];
        const double wide = fmin(0.6 * b->spacing[k], BRANCH_SCALE_MAX);
        const double thin = 0.15 + 0.85 * hair;
        double R[9], q[4], square = 0;

        for (size_t c = 0; c < 4; c++)
            square += (double)quat[c] * quat[c];
        for (size_t c = 0; c < 4; c++)
            q[c] = quat[c] / sqrt(square);
        rotation_quat_d(R, q);
        for (size_t c = 0; c < 3; c++) {
            off = fmax(off, fabs(R[3 * c + 2] - n[c] / len));
            size = fmax(size, fabs(scale[c] / (c == 2 ? thin * wide : wide) -
                                   1));
        }
        if (w.head.avatar.lining[k] == 0)       /* else lip_lining.h's */
            clear = fmax(clear, fabs(w.a.set.opacity[k] - 0.97));
    }
    check("third axis: the normal", off, 1e-5);
    check("size and thickness", size, 1e-5);
    check("opacity", clear, 1e-6);
    gradient_follow(&w, (const char *const[]){"dynamic.", NULL});
}

int main(void)
{
    nn_plans_use(&plans);
    gradient_run(true, 0);
    gradient_disks();
    gradient_run(false, 0);
    gradient_run(true, WITHOUT_INTERP);
    gradient_run(true, WITHOUT_DEFORM);
    gradient_run(true, WITHOUT_STATIC);
    gradient_run(true, WITHOUT_DYNAMIC);
    gradient_run(true, WITHOUT_MOUTH);
    gradient_run(true, WITHOUT_NECK);
    return check_status();
}
