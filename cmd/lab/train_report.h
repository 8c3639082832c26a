/* What spid-train says of a run on stderr. */
#ifndef SPID_CMD_LAB_TRAIN_REPORT_H
#define SPID_CMD_LAB_TRAIN_REPORT_H

#include "lib/lab/train/loop.h"

/* What is trained, and what stands in for what is not given. */
void train_report_run(const struct task *t);
/* The line of progress after a step. */
void train_report_step(const struct loop_report *r);
/* What loop.warn says. */
void train_report_warning(const char *text);
/* Time of a step and of a pass, what is summed over processes, and the
 * memory's most: what a longer run will need. */
void train_report_cost(const struct loop_cost *c);

#endif
