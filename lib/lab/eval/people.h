/* A model evaluated on people with known truth: self- and cross-reenactment,
 * motion, ablations. */
#ifndef SPID_LAB_EVAL_PEOPLE_H
#define SPID_LAB_EVAL_PEOPLE_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/lab/eval/lpips.h"
#include "lib/lab/eval/reenactor.h"
#include "lib/lab/eval/table.h"
#include "lib/lab/data/contact_sheet.h"

struct people_options {
    const char *stream;     /* of spid-synth: whole pictures of config.size */
    size_t people, frames;  /* at most; 0: all (frames) */
    bool ablations, cross;
    struct lpips *lpips;    /* for that column; NULL: there is none */
    /* Called after each person (may be NULL). */
    void (*progress)(size_t done, size_t total);
};

/* Rows of t: "SpiD", "SpiD*", "source" (the unchanged source frame), then
 * "w/o nothing" (SpiD* on the frames of what follows) and "w/o ..." of SpiD*,
 * then "cross"; from "w/o nothing" on of every fifth frame.  sheet (may be NULL) is
 * filled with the first people: source, driver, coarse, final, error, and the
 * dynamic, static and mouth branch alone; the caller releases it. */
int people_evaluate(struct table *t, struct contact_sheet *sheet,
                    struct reenactor *s,
                    const struct people_options *opt, struct error *err);

/* What papers name of its table, as one JSON object: "psnr", "ssim", ... of the
 * row SpiD, "psnr_star" of SpiD* and so on, null where nothing was measured, and
 * all rows under "rows". */
void summary_write(FILE *f, const struct table *t);

#endif
