/* The figures of a model that papers name, out of people_evaluate's table. */
#ifndef SPID_LAB_EVAL_SUMMARY_H
#define SPID_LAB_EVAL_SUMMARY_H

#include <stdio.h>

#include "lib/lab/eval/table.h"

/* One JSON object: "psnr", "ssim", ... of the row SpiD, "psnr_star" of SpiD*
 * and so on, null where nothing was measured, and all rows under "rows". */
void summary_write(FILE *f, const struct table *t);

#endif
