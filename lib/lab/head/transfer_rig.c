/* The rig of the scans' head.
 *
 * The scans' shapes add up: a jaw that opens moves everyone's chin by the same
 * lengths, whatever else the face does.  A jaw that carried skin by weights
 * would turn all of that with it, and be millimetres off on lips that open and
 * smile.  So no skin hangs on the jaw joint: its turn works through the pose
 * corrections alone, which are linear in R - I.  For a turn about x these are
 * sin at (2,1) and cos - 1 at (1,1), about y sin at (0,2) and cos - 1 at
 * (0,0); with two columns a drive meets its shapes exactly at two angles: half
 * and full for jawOpen, left and right for jawLeft and jawRight, up and down,
 * in and out for the eyes, whose joints turn the ball. */
#include "lib/lab/head/transfer.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/arkit.h"

/* Where the joints are, metres; the jaw's: where the scans' lower teeth turn
 * about under jawOpen, the eyes': their centres. */
static const double joint_root[3] = { 0, -0.120, -0.018 };
static const double joint_neck[3] = { 0, -0.062, -0.022 };
static const double joint_jaw[3] = { 0, -0.01647, 0.00519 };

/* Column of posedirs: entry (row, column) of R - I of joint j. */
static size_t transfer_posedir_column(int j, int row, int column)
{
    return (size_t)(9 * (j - 1) + 3 * row + column);
}

/* Skin hangs on root and neck. */
static void transfer_weights(struct template *s)
{
    for (size_t v = 0; v < s->nv; v++) {
        float *w = s->weights + TEMPLATE_JOINTS * v;

        w[JOINT_NECK] += w[JOINT_JAW];
        w[JOINT_JAW] = 0;
    }
}

/* ---- joints ------------------------------------------------------------- */

/* Whether joint j hangs on vertex v: eyes on their ball; the others on skin of
 * about their height that no expression moves. */
static int transfer_joint_carries(const struct template *s, int j, size_t v,
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
static int transfer_regress_joint(float *row, const struct template *s, int j,
                                  const double *still, const double at[3])
{
    double u[3] = {0}, q[3] = {1e-9, 1e-9, 1e-9}, k[3] = {0}, n = 0;
    const float *p = s->v_template;

    for (size_t v = 0; v < s->nv; v++)
        if (transfer_joint_carries(s, j, v, still, at)) {
            for (size_t c = 0; c < 3; c++)
                u[c] += p[3 * v + c];
            n++;
        }
    for (int c = 0; n > 0 && c < 3; c++)
        u[c] /= n;
    for (size_t v = 0; v < s->nv; v++)
        for (size_t c = 0; transfer_joint_carries(s, j, v, still, at) &&
             c < 3; c++)
            q[c] += (p[3 * v + c] - u[c]) * (p[3 * v + c] - u[c]) / n;
    for (int round = 0; round < 200; round++) {
        double got[3] = {0};

        for (size_t v = 0; v < s->nv; v++) {
            double w = 1;

            row[v] = 0;
            if (!transfer_joint_carries(s, j, v, still, at))
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
static int transfer_joints(struct template *s, const double *expressions,
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
    const double *at[TEMPLATE_JOINTS] = {joint_root, joint_neck, joint_jaw,
                                       left, right};
    for (int j = 0; j < TEMPLATE_JOINTS && !rc; j++)
        if (transfer_regress_joint(s->j_regressor + (size_t)j * s->nv, s, j,
                                   still, at[j]))
            rc = error_set(err, EX_DATAERR, "joint %d hangs on nothing "
                           "(expected skin that stays still)", j);
    free(still);
    return rc;
}

/* ---- corrections -------------------------------------------------------- */

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
static void transfer_corrections(struct template *s, const struct drive *d,
                                 const double *expressions)
{
    /* the sine of a turn about x stands at (2,1), about y at (0,2) */
    size_t sine = d->axis ? transfer_posedir_column(d->joint, 0, 2)
                          : transfer_posedir_column(d->joint, 2, 1);
    size_t cosine = d->axis ? transfer_posedir_column(d->joint, 0, 0)
                            : transfer_posedir_column(d->joint, 1, 1);
    double m[2][2], det;

    for (int i = 0; i < 2; i++) {
        m[i][0] = sin(d->at[i].angle);
        m[i][1] = cos(d->at[i].angle) - 1;
    }
    det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    for (size_t v = 0; v < s->nv; v++) {
        if (s->region[v] == REGION_EYEBALL)
            continue;
        for (size_t c = 0; c < 3; c++) {
            float *out = s->posedirs + (3 * v + c) * TEMPLATE_POSES;
            double p[2];

            for (int i = 0; i < 2; i++)
                p[i] = d->at[i].share *
                       expressions[3 * (s->nv * (size_t)d->at[i].shape + v) +
                                   c];
            out[sine] = (float)((m[1][1] * p[0] - m[0][1] * p[1]) / det);
            out[cosine] = (float)((m[0][0] * p[1] - m[1][0] * p[0]) / det);
        }
    }
}

int transfer_rig(struct template *s, const double *expressions,
                 struct error *err)
{
    size_t n = 3 * s->nv;

    if (transfer_joints(s, expressions, err))
        return -1;
    transfer_weights(s);
    memset(s->posedirs, 0, n * TEMPLATE_POSES * sizeof *s->posedirs);
    for (size_t i = 0; i < sizeof drives / sizeof *drives; i++)
        transfer_corrections(s, &drives[i], expressions);
    for (size_t i = 0; i < n; i++) {
        s->l_eyelid[i] = (float)expressions[n * ARKIT_EYE_BLINK_L + i];
        s->r_eyelid[i] = (float)expressions[n * ARKIT_EYE_BLINK_R + i];
    }
    return 0;
}
