/* A model judged on people with known truth: self- and cross-reenactment,
 * motion, ablations. */
#ifndef SPID_EVAL_PEOPLE_H
#define SPID_EVAL_PEOPLE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/eval/subject.h"
#include "lib/eval/table.h"
#include "lib/train/sheet.h"

struct people_options {
    const char *stream;     /* of spid-synth: whole pictures of config.size */
    size_t people, frames;  /* at most; 0: all (frames) */
    size_t stride;          /* ablations and cross look at every so many
                             * frames */
    int ablations, cross;
    size_t sheet_rows;      /* 0: no contact sheet */
    /* Called after each person (may be NULL). */
    void (*progress)(size_t done, size_t total);
};

#define PEOPLE_SHEET_COLS 8 /* source, driver, coarse, final, error, and the
                             * dynamic, static and mouth branch alone */

/* Rows of t: "SpiD", "SpiD*", "source" (the unchanged source frame), then
 * "w/o nothing" (SpiD* on the frames of what follows) and "w/o ..." of SpiD*,
 * then "cross".  sheet (may be NULL) is filled; the caller releases it. */
int people_judge(struct table *t, struct sheet *sheet, struct subject *s,
                 const struct people_options *opt, struct error *err);

#endif
