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

#include <math.h>
#include <string.h>

#include "lib/head/arkit.h"
#include "lib/head/head.h"

/* Column of posedirs: entry (row, column) of R - I of joint j. */
static size_t transfer_posedir_column(int j, int row, int column)
{
    return (size_t)(9 * (j - 1) + 3 * row + column);
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

void transfer_rig(struct template *s, const double *expressions)
{
    size_t n = 3 * s->nv;

    memset(s->posedirs, 0, n * TEMPLATE_POSES * sizeof *s->posedirs);
    for (size_t i = 0; i < sizeof drives / sizeof *drives; i++)
        transfer_corrections(s, &drives[i], expressions);
    for (size_t i = 0; i < n; i++) {
        s->l_eyelid[i] = (float)expressions[n * ARKIT_EYE_BLINK_L + i];
        s->r_eyelid[i] = (float)expressions[n * ARKIT_EYE_BLINK_R + i];
    }
}
