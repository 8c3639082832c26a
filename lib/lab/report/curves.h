/* Motions as curves over time: what drove, what the result shows, and what an
 * avatar that does not move would. */
#ifndef SPID_LAB_REPORT_CURVES_H
#define SPID_LAB_REPORT_CURVES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "lib/base/error.h"
#include "lib/base/crop.h"
#include "lib/head/arkit.h"

/* Degrees, then 0 to 1. */
enum curve { CURVE_YAW, CURVE_PITCH, CURVE_ROLL, CURVE_JAW, CURVE_LID_LEFT,
             CURVE_LID_RIGHT, CURVE_GAZE_ACROSS, CURVE_GAZE_UP, CURVE_EXP,
             CURVES = CURVE_EXP + ARKIT_EXP };

struct curves {
    size_t n, room;
    double *time;               /* (n) seconds */
    double *y[CURVES];          /* (n) each */
    struct square window;       /* of the clip, from CONF */
    bool has_window;
};

/* Every MOTN record of the stream at path, or only the first.  Expression
 * components that a record does not have are 0. */
int curves_read(struct curves *c, const char *path, bool first,
                struct error *err);
/* Free what it holds; zeroed then. */
void curves_release(struct curves *c);

/* Charts of driver against result (may be empty) and truth (may be empty),
 * with what `still` (may be empty) shows as a line: pose, jaw, lids, gaze and
 * the expression components that the driver moves most.  Under each: mean
 * difference, the same of the still line, and correlation. */
void curves_write(FILE *f, const struct curves *driver,
                  const struct curves *result, const struct curves *truth,
                  const struct curves *still);

#endif
