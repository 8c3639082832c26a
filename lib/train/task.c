#include "lib/train/task.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <string.h>

int task_init(struct task *t, const struct train_config *c,
              const struct head *h, struct error *err)
{
    memset(t, 0, sizeof *t);
    t->config = c;
    t->head = h;
    params_init(&t->ps);
    if (c->stage == STAGE_SHAPE)
        return task_shape_init(t, err);
    if (c->stage == STAGE_MOTION)
        return task_motion_init(t, err);
    return task_avatar_init(t, err);
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
