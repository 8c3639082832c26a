/* What training E_m alone and training E_beta alone have in common: a pass's
 * crops with their items, and a sheet of crops. */
#ifndef SPID_LAB_TRAIN_ENCODER_TASK_H
#define SPID_LAB_TRAIN_ENCODER_TASK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/data/data.h"
#include "lib/nn/params.h"
#include "lib/lab/train/task.h"

/* One crop of a pass. */
struct encoder_item {
    const struct data_person *who;
    const struct data_frame *frame;     /* the stream's, or */
    struct data_frame rotated;           /* turned in its plane */
    struct square q;            /* the part of the frame that was cut */
    struct random r;            /* behind what the crop drew */
};

struct encoder_task {
    size_t batch, outputs;      /* B = config.micro; numbers of an output */
    bool pairs;                 /* odd items are other frames of the people
                                 * before them, seen alike */
    struct encoder_item *item;  /* (B) */
    float *rgb;                 /* (B,224,224,3) */
    float *out, *dout;          /* (B,outputs) and its gradient */
};

/* Memory for a pass of t, which owns it, and an encoder of so many outputs. */
int encoder_task_init(struct encoder_task *e, struct task *t, size_t outputs,
                      struct error *err);

/* Draw and cut the items of pass `micro` of a step. */
int encoder_task_draw(struct encoder_task *e, const struct task *t,
                      uint64_t step, size_t micro, struct error *err);

/* A task_type's sheet: the validation people's crops as the encoder receives
 * them, where a struct encoder_task begins the task's impl. */
int encoder_task_sheet(struct task *t, struct contact_sheet *sh,
                       struct error *err);

/* After the task's tensors were declared: gradients and random weights.  What is
 * declared from here on, for validation, is on the same tensors. */
int encoder_task_fill(struct task *t, struct error *err);

#endif
