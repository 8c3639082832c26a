/* What training E_m alone and training E_beta alone have in common: a pass's
 * crops with their items, and a copy of the weights for validation. */
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
    struct params copy;         /* of the validation network, as task.ps */
};

/* Memory for a pass of t, which owns it, and an encoder of so many outputs; the
 * caller releases e->copy. */
int encoder_task_init(struct encoder_task *e, struct task *t, size_t outputs,
                      struct error *err);

/* Draw and cut the items of pass `micro` of a step. */
int encoder_task_draw(struct encoder_task *e, const struct task *t,
                      uint64_t step, size_t micro, struct error *err);

/* A task_type's sheet: the validation people's crops as the encoder receives
 * them, where a struct encoder_task begins the task's impl. */
int encoder_task_sheet(struct task *t, struct contact_sheet *sh,
                       struct error *err);

/* After the task's tensors were declared: gradients and random weights. */
int encoder_task_fill(struct task *t, struct error *err);
/* After the validation network was declared in copy: room for its weights. */
int encoder_task_allocate_copy(struct encoder_task *e, const struct task *t,
                               struct error *err);
/* copy = the task's weights as they are, and all plans are told. */
void encoder_task_copy(struct encoder_task *e, const struct task *t);

#endif
