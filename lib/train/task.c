#include "lib/train/task.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

static int make(struct task *t, struct error *err)
{
    switch (t->config->stage) {
    case STAGE_SHAPE:
        return task_shape_init(t, err);
    case STAGE_MOTION:
        return task_motion_init(t, err);
    default:
        return task_avatar_init(t, err);
    }
}

/* The configuration's "freeze": it must name something. */
static int freeze(struct params *ps, const char *prefix, struct error *err)
{
    size_t found = 0;

    for (size_t i = 0; *prefix && i < ps->count; i++)
        if (!strncmp(ps->tensor[i].name, prefix, strlen(prefix))) {
            ps->tensor[i].frozen = true;
            found++;
        }
    return *prefix && !found
               ? error_set(err, EX_CONFIG, "freeze: no tensor's name begins "
                           "with \"%s\"", prefix)
               : 0;
}

int task_init(struct task *t, const struct train_config *c,
              const struct head *h, struct error *err)
{
    memset(t, 0, sizeof *t);
    t->config = c;
    t->head = h;
    params_init(&t->ps);
    return make(t, err) ? -1 : freeze(&t->ps, c->freeze, err);
}

void task_release(struct task *t)
{
    if (t->type)
        t->type->release(t);
    params_release(&t->ps);
    memset(t, 0, sizeof *t);
}

const char *task_net(char *out, size_t size, const struct train_config *c,
                     const char *object, const char *normal)
{
    cJSON *json = c->model ? cJSON_Parse(c->model) : NULL;
    const cJSON *part = json ? cJSON_GetObjectItem(json, object) : NULL;
    const cJSON *net = part ? cJSON_GetObjectItem(part, "net") : NULL;

    snprintf(out, size, "%s",
             cJSON_IsString(net) ? net->valuestring : normal);
    cJSON_Delete(json);
    return out;
}

const struct data_frame *task_draw(const struct task *t,
                                   const struct data_person **who,
                                   struct random *r)
{
    uint32_t people = (uint32_t)t->pool->size;
    const struct data_person *p = &t->pool->person[random_below(r, people)];

    *who = p;
    return &p->frame[random_below(r, (uint32_t)p->count)];
}
