/* The training loop: steps, guard, checkpoints, log. */
#ifndef SPID_LAB_TRAIN_LOOP_H
#define SPID_LAB_TRAIN_LOOP_H

#include <signal.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/train/checkpoint.h"
#include "lib/lab/train/config.h"
#include "lib/lab/train/group.h"
#include "lib/lab/train/task.h"

#define LOOP_MAX_BAD 5  /* steps skipped in a row before the run ends */

/* What one step gave, for whoever shows it. */
struct loop_report {
    uint64_t step, steps;
    double loss, norm, rate, seconds, items_per_second, left;
    const double *parts;
    const struct task *task;
};

/* What the steps of this process took, all together. */
struct loop_cost {
    uint64_t steps, passes;
    double seconds;             /* data, passes, sums and update */
    double pass_seconds;
    double sum_seconds;         /* sums over the processes, */
    size_t sum_bytes;           /* and their size in one step */
};

struct loop {
    const struct train_config *config;
    struct task *task;
    struct group *group;
    struct data_reader *reader;
    const char *folder;             /* checkpoints, log, sheets, model */
    const struct checkpoint_source *init;
    size_t ninit;
    volatile sig_atomic_t *stop;    /* set by a signal: end after this step */
    /* Shown by the program; either may be NULL.  bad names a tensor whose
     * numbers are not finite. */
    void (*report)(const struct loop_report *r);
    void (*warn)(const char *text);
    /* Outcome. */
    uint64_t step, skipped;
    double figures[TASK_PARTS]; /* of the last validation */
    struct loop_cost cost;
};

/* Run to config->steps, from the checkpoint in folder where there is one.
 * The folder then holds checkpoint.safetensors, log.tsv, held.tsv,
 * sheet-NNNNNN.png and model.safetensors (the averaged weights, f32). */
int loop_run(struct loop *l, struct error *err);

#endif
