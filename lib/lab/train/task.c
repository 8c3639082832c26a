/* A task by its stage's name. */
#include "lib/lab/train/task.h"

#include <string.h>
#include <sysexits.h>

/* The type of a stage. */
static const struct task_type *task_find_type(enum train_stage stage)
{
    switch (stage) {
    case STAGE_SHAPE:
        return &shape_task;
    case STAGE_MOTION:
        return &motion_task;
    case STAGE_LIGHT:
        return &light_task;
    case STAGE_MATTE:
        return &matte_task;
    case STAGE_CONFIDENCE:
        return &confidence_task;
    default:
        return &avatar_task;
    }
}

/* What every stage begins with, and its own constructor. */
static int task_make(struct task *t, struct error *err)
{
    const struct task_type *type = task_find_type(t->config->stage);

    t->type = type;
    t->nparts = type->nparts;
    t->nfigures = type->nfigures;
    memcpy(t->part_name, type->part_name,
           (size_t)t->nparts * sizeof *t->part_name);
    memcpy(t->figure_name, type->figure_name,
           (size_t)t->nfigures * sizeof *t->figure_name);
    t->impl = arena_take(&t->memory, 1, type->size);
    if (arena_check(&t->memory, "a task", err))
        return -1;
    nn_plans_use(&t->plans);
    const int rc = type->init(t, err);
    nn_plans_use(NULL);
    return rc;
}

/* The configuration's "freeze", or what its "learn" leaves out; a prefix must
 * name something. */
static int task_freeze(struct params *ps, const char *prefix, bool learn,
                       struct error *err)
{
    size_t found = 0;

    for (size_t i = 0; *prefix && i < ps->count; i++) {
        bool named = !strncmp(ps->tensor[i].name, prefix, strlen(prefix));

        ps->tensor[i].frozen = ps->tensor[i].frozen || named != learn;
        found += named;
    }
    return *prefix && !found
               ? error_set(err, EX_CONFIG, "%s: no tensor's name begins with "
                           "\"%s\"", learn ? "learn" : "freeze", prefix)
               : 0;
}

int task_init(struct task *t, const struct train_config *c,
              const struct head *h, struct error *err)
{
    memset(t, 0, sizeof *t);
    t->config = c;
    t->head = h;
    params_init(&t->ps);
    return task_make(t, err) || task_freeze(&t->ps, c->freeze, false, err) ||
                   task_freeze(&t->ps, c->learn, true, err)
               ? -1
               : 0;
}

int task_read_validation(struct task *t, struct data_reader *r,
                         struct error *err)
{
    size_t max = (size_t)t->config->validation_people;

    t->validation = arena_take(&t->memory, max, sizeof *t->validation);
    if (arena_check(&t->memory, "people of validation", err))
        return -1;
    data_once(r);
    for (; t->nvalidation < max; t->nvalidation++) {
        int rc = data_next(r, &t->validation[t->nvalidation], err);
        if (rc)
            return rc < 0 ? -1 : 0;
    }
    return 0;
}

void task_release(struct task *t)
{
    for (size_t i = 0; i < t->nvalidation; i++)
        data_person_release(&t->validation[i]);
    if (t->impl && t->type->release)
        t->type->release(t);
    params_release(&t->ps);
    nn_plans_release(&t->plans);
    arena_release(&t->memory);
    memset(t, 0, sizeof *t);
}
