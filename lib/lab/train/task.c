/* A task by its stage's name. */
#include "lib/lab/train/task.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* The stage's own constructor. */
static int task_make(struct task *t, struct error *err)
{
    switch (t->config->stage) {
    case STAGE_SHAPE:
        return task_shape_init(t, err);
    case STAGE_MOTION:
        return task_motion_init(t, err);
    case STAGE_LIGHT:
        return task_light_init(t, err);
    case STAGE_MATTE:
        return task_matte_init(t, err);
    case STAGE_CONFIDENCE:
        return task_confidence_init(t, err);
    default:
        return task_avatar_init(t, err);
    }
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

    t->validation = calloc(max, sizeof *t->validation);
    if (!t->validation)
        return error_set(err, EX_OSERR, "out of memory (%zu people)", max);
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
    free(t->validation);
    if (t->type)
        t->type->release(t);
    params_release(&t->ps);
    memset(t, 0, sizeof *t);
}
