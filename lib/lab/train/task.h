/* What is trained, as the loop sees it: a model with parameters that turns a
 * part of a step's batch into losses and gradients. */
#ifndef SPID_LAB_TRAIN_TASK_H
#define SPID_LAB_TRAIN_TASK_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"
#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"
#include "lib/lab/train/config.h"
#include "lib/lab/data/contact_sheet.h"
#include "lib/lab/data/data.h"

#define TASK_PARTS 24

struct task;

/* A stage.  init declares, allocates and fills the tensors of t->ps from the
 * seed; impl, with `size` bytes, is there and zeroed, and so are the names.  What
 * it takes from t->memory goes with the task, the rest by release, which has to
 * take whatever a failed init has left. */
struct task_type {
    size_t size;                /* of its struct impl */
    double margin;              /* of the pictures it wants: see data_open */
    int nparts, nfigures;
    const char *const *part_name, *const *figure_name;
    int (*init)(struct task *t, struct error *err);
    void (*release)(struct task *t);    /* NULL: nothing is left */
    /* Pass `micro` of a step: adds losses to parts, divided by the number of
     * passes, and gradients to ps->g (and opponent->g) likewise. */
    int (*pass)(struct task *t, double *parts, uint64_t step, size_t micro,
                struct error *err);
    /* Figures on people never trained on, of the weights in ps, which all plans
     * were told of: names in figure_name. */
    int (*validate)(struct task *t, double *figures, struct error *err);
    /* A contact sheet of what they do, released by the caller. */
    int (*sheet)(struct task *t, struct contact_sheet *sh, struct error *err);
};

struct task {
    const struct task_type *type;
    const struct train_config *config;
    const struct head *head;
    struct data_pool *pool;     /* people to train on */
    struct data_person *validation; /* people never trained on */
    size_t nvalidation;
    const struct scenery *scenery;  /* without faces, for task_confidence and
                                     * task_matte; NULL: none */
    struct params ps;
    struct nn_plans plans;      /* that init made, of ps and *opponent */
    struct params *opponent;    /* of a network that learns against ps, with an
                                 * Adam of its own, from opponent_from on, and
                                 * that no model file has; NULL: none */
    uint64_t opponent_from;     /* a step */
    double opponent_rate;
    int nparts, nfigures;       /* the loss is the sum of the parts; */
    int nwatched;               /* so many more follow in the log */
    const char *part_name[TASK_PARTS];
    const char *figure_name[TASK_PARTS];
    struct arena memory;
    void *impl;                 /* in it */
};

/* Make the task of the configuration's stage.  pool and validation are set by the
 * caller before the first pass. */
int task_init(struct task *t, const struct train_config *c,
              const struct head *h, struct error *err);
/* Free what it holds; zeroed then. */
void task_release(struct task *t);
/* At most config->validation_people of one pass become t->validation. */
int task_read_validation(struct task *t, struct data_reader *r,
                         struct error *err);

/* The stages: E_m, E_beta, the light network, how sure E_m is, the matte
 * network, branches and refiner or all of the model. */
extern const struct task_type motion_task, shape_task, light_task,
    confidence_task, matte_task, avatar_task;

#endif
