/* The rig of the scans' head.
 *
 * The jaw turns by R about its joint J and carries a vertex by its weight w.
 * What the scans' shape E moves beyond that is a pose correction p, added to
 * the vertex T before it is skinned.  At weight a of the shape (angle a theta)
 *     (1 - w)(T + p) + w (R (T + p - J) + J) = T + a E
 *  =>  p = M^-1 (a E - w (R - I)(T - J)),   M = (1 - w) I + w R.
 * Corrections are linear in the entries of R - I.  For a turn about x these
 * are sin at (2,1) and cos - 1 at (1,1), about y sin at (0,2) and cos - 1 at
 * (0,0); two of them are met exactly at two angles: half and full for
 * jawOpen, left and right for jawLeft/Right, up and down, in and out for the
 * eyes, whose joints carry only the ball while the lids are corrections. */
#include "lib/head/transfer.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/arkit.h"
#include "lib/head/smooth.h"

/* Where the joints are, metres; the jaw's: where the scans' lower teeth turn
 * about under jawOpen, the eyes': their centres. */
static const double joint_root[3] = { 0, -0.120, -0.018 };
static const double joint_neck[3] = { 0, -0.062, -0.022 };
static const double joint_jaw[3] = { 0, -0.01647, 0.00519 };

/* Column of posedirs: entry (row, column) of R - I of joint j. */
static size_t entry(int j, int row, int column)
{
    return (size_t)(9 * (j - 1) + 3 * row + column);
}

static void turn(double R[9], int axis, double angle)
{
    double c = cos(angle), s = sin(angle);
    int a = (axis + 1) % 3, b = (axis + 2) % 3;

    memset(R, 0, 9 * sizeof *R);
    R[4 * axis] = 1;
    R[4 * a] = R[4 * b] = c;
    R[3 * a + b] = -s;
    R[3 * b + a] = s;
}

/* ---- weights ---------------------------------------------------------------- */

/* How much of the jaw's turn each vertex makes under jawOpen: the least
 * squares share, damped near the axis, evened out a little. */
static int jaw_shares(double *share, const struct sculpt *s,
                      const struct registration *r, const double *open,
                      struct error *err)
{
    struct smooth_mesh mesh;
    double R[9], *x = calloc(3 * s->nv, sizeof *x);

    if (!x || smooth_mesh_init(&mesh, s->f, s->nf, s->nv, err)) {
        free(x);
        return error_set(err, EX_OSERR, "no memory for weights");
    }
    turn(R, 0, ARKIT_JAW_OPEN);
    for (size_t v = 0; v < s->nv; v++) {
        double aa = 0.005 * 0.005, ae = 0;
        const double *e = open + 3 * v;

        for (int i = 0; i < 3; i++) {
            double a = 0;

            for (int k = 0; k < 3; k++)
                a += (R[3 * i + k] - (i == k)) *
                     (r->at[3 * v + (size_t)k] - joint_jaw[k]);
            aa += a * a;
            ae += a * e[i];
        }
        x[3 * v] = s->region[v] == REGION_EYEBALL ? 0 : clamp01(ae / aa);
    }
    for (int round = 0; round < 2; round++)
        for (size_t v = 0; v < s->nv; v++) {
            double mean[3];

            smooth_mean(mean, &mesh, x, v);
            /* lips keep their edge: upper and lower are joined inside */
            if (s->region[v] != REGION_LIPS &&
                s->region[v] != REGION_INNER_MOUTH)
                x[3 * v] = mix(x[3 * v], mean[0], 0.4);
        }
    for (size_t v = 0; v < s->nv; v++)
        share[v] = x[3 * v] < 0.01 ? 0 : x[3 * v];
    smooth_mesh_release(&mesh);
    free(x);
    return 0;
}

static void set_weights(struct sculpt *s, const double *share)
{
    for (size_t v = 0; v < s->nv; v++) {
        float *w = s->weights + SCULPT_JOINTS * v;
        float neck = w[JOINT_NECK] + w[JOINT_JAW];

        if (s->region[v] == REGION_EYEBALL)
            continue;
        w[JOINT_JAW] = (float)share[v] * neck;
        w[JOINT_NECK] = neck - w[JOINT_JAW];
    }
}

/* ---- joints ----------------------------------------------------------------- */

/* Whether joint j hangs on vertex v: eyes on their ball; the others on skin of
 * about their height that no expression moves. */
static int carries(const struct sculpt *s, int j, size_t v,
                   const double *still, const double at[3])
{
    const float *p = s->v_template + 3 * v;

    if (j >= JOINT_EYE_LEFT)
        return s->region[v] == REGION_EYEBALL &&
               (p[0] > 0) == (j == JOINT_EYE_LEFT);
    return s->region[v] != REGION_EYEBALL && still[v] < 1.5e-4 &&
           fabs(p[1] - at[1]) < 0.030 && fabs(p[2] - at[2]) < 0.080;
}

/* Weights linear in the distance from the carriers' mean move it to `at` and
 * keep their sum: w = (1 + (x - u) . k) / n. */
static int regress_joint(float *row, const struct sculpt *s, int j,
                         const double *still, const double at[3])
{
    double u[3] = {0}, q[3] = {1e-9, 1e-9, 1e-9}, k[3] = {0}, n = 0;
    const float *p = s->v_template;

    for (size_t v = 0; v < s->nv; v++)
        if (carries(s, j, v, still, at)) {
            for (size_t c = 0; c < 3; c++)
                u[c] += p[3 * v + c];
            n++;
        }
    for (int c = 0; n > 0 && c < 3; c++)
        u[c] /= n;
    for (size_t v = 0; v < s->nv; v++)
        for (size_t c = 0; carries(s, j, v, still, at) && c < 3; c++)
            q[c] += (p[3 * v + c] - u[c]) * (p[3 * v + c] - u[c]) / n;
    for (int round = 0; round < 200; round++) {
        double got[3] = {0};

        for (size_t v = 0; v < s->nv; v++) {
            double w = 1;

            row[v] = 0;
            if (!carries(s, j, v, still, at))
                continue;
            for (size_t c = 0; c < 3; c++)
                w += (p[3 * v + c] - u[c]) * k[c];
            row[v] = (float)(w / n);
            for (size_t c = 0; c < 3; c++)
                got[c] += row[v] * p[3 * v + c];
        }
        for (int c = 0; c < 3; c++)
            k[c] += 0.6 * (at[c] - got[c]) / q[c];
    }
    return n > 8 ? 0 : -1;
}

/* still (nv): how far the strongest expression moves each vertex. */
static int set_joints(struct sculpt *s, const double *expressions,
                      struct error *err)
{
    double *still = calloc(s->nv, sizeof *still);
    double left[3], right[3];
    int rc = 0;

    if (!still)
        return error_set(err, EX_OSERR, "no memory for joints");
    for (size_t k = 0; k < ARKIT_COUNT; k++)
        for (size_t v = 0; v < s->nv; v++) {
            const double *e = expressions + 3 * (k * s->nv + v);

            still[v] = fmax(still[v], sqrt(e[0] * e[0] + e[1] * e[1] +
                                           e[2] * e[2]));
        }
    scan_eye(left, 0);
    scan_eye(right, 1);
    const double *at[SCULPT_JOINTS] = {joint_root, joint_neck, joint_jaw,
                                       left, right};
    for (int j = 0; j < SCULPT_JOINTS && !rc; j++)
        if (regress_joint(s->j_regressor + (size_t)j * s->nv, s, j, still,
                          at[j]))
            rc = error_set(err, EX_DATAERR, "joint %d hangs on nothing "
                           "(expected skin that stays still)", j);
    free(still);
    return rc;
}

/* ---- corrections ------------------------------------------------------------ */

/* out = M^-1 b, M = (1 - w) I + w R. */
static void unskin(double out[3], const double R[9], double w,
                   const double b[3])
{
    double m[9], det;

    for (int i = 0; i < 9; i++)
        m[i] = w * R[i] + (i % 4 == 0 ? 1 - w : 0);
    double c[9] = {
        m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8],
        m[1] * m[5] - m[2] * m[4], m[5] * m[6] - m[3] * m[8],
        m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
        m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7],
        m[0] * m[4] - m[1] * m[3] };
    det = m[0] * c[0] + m[1] * c[3] + m[2] * c[6];
    for (int i = 0; i < 3; i++)
        out[i] = (c[3 * i] * b[0] + c[3 * i + 1] * b[1] +
                  c[3 * i + 2] * b[2]) / det;
}

/* p of vertex v when joint j turns about an axis by `angle` and the scans move
 * it by `share` of e. */
static void correction(double p[3], const struct sculpt *s, int j, int axis,
                       double angle, const double *e, double share, size_t v)
{
    double R[9], b[3], w = j == JOINT_JAW
                           ? s->weights[SCULPT_JOINTS * v + JOINT_JAW] : 0;

    turn(R, axis, angle);
    for (int i = 0; i < 3; i++) {
        b[i] = share * e[3 * v + (size_t)i];
        for (int k = 0; k < 3; k++)
            b[i] -= w * (R[3 * i + k] - (i == k)) *
                    (s->v_template[3 * v + (size_t)k] - joint_jaw[k]);
    }
    unskin(p, R, w, b);
}

/* A turn of a joint about an axis that says two shapes. */
struct drive {
    int joint, axis;            /* 0: x, 1: y */
    struct { int shape; double angle, share; } at[2];
};
static const struct drive drives[] = {
    { JOINT_JAW, 0, { { ARKIT_JAW_OPENED, ARKIT_JAW_OPEN, 1 },
                      { ARKIT_JAW_OPENED, ARKIT_JAW_OPEN / 2, 0.5 } } },
    { JOINT_JAW, 1, { { ARKIT_JAW_LEFT, ARKIT_JAW_SIDE, 1 },
                      { ARKIT_JAW_RIGHT, -ARKIT_JAW_SIDE, 1 } } },
    { JOINT_EYE_LEFT, 0, { { ARKIT_EYE_LOOK_DOWN_L, ARKIT_EYE_DOWN, 1 },
                           { ARKIT_EYE_LOOK_UP_L, -ARKIT_EYE_UP, 1 } } },
    { JOINT_EYE_LEFT, 1, { { ARKIT_EYE_LOOK_OUT_L, ARKIT_EYE_OUT, 1 },
                           { ARKIT_EYE_LOOK_IN_L, -ARKIT_EYE_IN, 1 } } },
    { JOINT_EYE_RIGHT, 0, { { ARKIT_EYE_LOOK_DOWN_R, ARKIT_EYE_DOWN, 1 },
                            { ARKIT_EYE_LOOK_UP_R, -ARKIT_EYE_UP, 1 } } },
    { JOINT_EYE_RIGHT, 1, { { ARKIT_EYE_LOOK_IN_R, ARKIT_EYE_IN, 1 },
                            { ARKIT_EYE_LOOK_OUT_R, -ARKIT_EYE_OUT, 1 } } },
};

/* The two columns of posedirs of a drive: p = sin A + (cos - 1) B at both
 * angles. */
static void set_corrections(struct sculpt *s, const struct drive *d,
                            const double *expressions)
{
    /* the sine of a turn about x stands at (2,1), about y at (0,2) */
    size_t sine = d->axis ? entry(d->joint, 0, 2) : entry(d->joint, 2, 1);
    size_t cosine = d->axis ? entry(d->joint, 0, 0) : entry(d->joint, 1, 1);
    double m[2][2], det;

    for (int i = 0; i < 2; i++) {
        m[i][0] = sin(d->at[i].angle);
        m[i][1] = cos(d->at[i].angle) - 1;
    }
    det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    for (size_t v = 0; v < s->nv; v++) {
        double p[2][3];

        if (s->region[v] == REGION_EYEBALL)
            continue;
        for (int i = 0; i < 2; i++)
            correction(p[i], s, d->joint, d->axis, d->at[i].angle,
                       expressions + 3 * s->nv * (size_t)d->at[i].shape,
                       d->at[i].share, v);
        for (size_t c = 0; c < 3; c++) {
            float *out = s->posedirs + (3 * v + c) * SCULPT_POSES;

            out[sine] = (float)((m[1][1] * p[0][c] - m[0][1] * p[1][c]) /
                                det);
            out[cosine] = (float)((m[0][0] * p[1][c] - m[1][0] * p[0][c]) /
                                  det);
        }
    }
}

int transfer_rig(struct sculpt *s, const struct registration *r,
                 const double *expressions, struct error *err)
{
    size_t n = 3 * s->nv;
    double *share = calloc(s->nv, sizeof *share);

    if (!share)
        return error_set(err, EX_OSERR, "no memory for a rig");
    int rc = jaw_shares(share, s, r, expressions + n * ARKIT_JAW_OPENED, err)
             || set_joints(s, expressions, err) ? -1 : 0;
    if (!rc) {
        set_weights(s, share);
        memset(s->posedirs, 0, n * SCULPT_POSES * sizeof *s->posedirs);
        for (size_t i = 0; i < sizeof drives / sizeof *drives; i++)
            set_corrections(s, &drives[i], expressions);
        for (size_t i = 0; i < n; i++) {
            s->l_eyelid[i] = (float)expressions[n * ARKIT_EYE_BLINK_L + i];
            s->r_eyelid[i] = (float)expressions[n * ARKIT_EYE_BLINK_R + i];
        }
    }
    free(share);
    return rc;
}
