/* Two clips against each other, frame by frame: pictures and motions. */
#ifndef SPID_LAB_EVAL_COMPARE_H
#define SPID_LAB_EVAL_COMPARE_H

#include <stddef.h>
#include <stdio.h>

#include "lib/base/error.h"
#include "lib/lab/eval/likeness.h"
#include "lib/lab/eval/pairs.h"
#include "lib/lab/eval/table.h"
#include "lib/head/head.h"
#include "lib/lab/eval/lpips.h"
#include "lib/lab/eval/musiq.h"
#include "lib/lab/eval/topiq.h"

/* Receives a line per frame: name of the pair, frame, values in the order of the
 * columns the call used. */
struct compare_log {
    FILE *tsv;              /* NULL: none */
    const char *pair;
};
/* The line of names before a pair's frames, and one of values; log may be
 * NULL. */
void compare_log_names(const struct compare_log *log,
                       const char *const *names, int count);
void compare_log_frame(const struct compare_log *log, size_t frame,
                       const double *value, int count);

/* Networks whose weights were given; each may be NULL. */
struct compare_nets {
    struct lpips *lpips;
    struct likeness *likeness;
    struct musiq *musiq;
    struct topiq *topiq;
};

/* Rows that a comparison of frames fills. */
struct compare_rows {
    size_t result;
    size_t unchanged;       /* the null line: the truth's first frame in place
                             * of every later one; TABLE_NO_ROW: none */
};

/* Compare the frames of a pair's truth and result (see framesource_open):
 * columns psnr ssim msssim l1 flicker and, their weights given, lpips and
 * arcface (likeness of result and truth), arcface_src (of result and the
 * pair's source; NULL: no such column), musiq and topiq (of the result alone).
 * With a null line also psnr_first (of frame 0), psnr_later (of the others),
 * beats_0_pct (100 where a later frame's psnr is above the null line's, else 0)
 * and edge_ratio (metric_edges of result over truth).  ms-ssim of pictures under
 * 161 pixels counts as failed, as do topiq of those under TOPIQ_MIN, the psnr of
 * equal frames (infinite) and the likeness of a frame without a face.  -1 when
 * sizes or numbers of frames differ or a file cannot be read; what was measured
 * until then stays in the table. */
int compare_frames(struct table *t, const struct compare_rows *rows,
                   const struct pair *p, const struct compare_nets *nets,
                   const struct compare_log *log, struct error *err);

/* Compare the MOTN records of two streams: columns akd aed apd (pixels of a
 * 512 picture) pose_deg yaw_deg pitch_deg roll_deg landmark_pct jaw_corr
 * blink_corr.  Landmarks are the records' `lmk` where there are any, else
 * those of head h (may be NULL: then akd, aed, apd fail) posed and projected,
 * with the stream's SHAP. */
int compare_motions(struct table *t, size_t row, const char *truth,
                    const char *result, const struct head *h,
                    const struct compare_log *log, struct error *err);

#endif
