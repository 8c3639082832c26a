/* Maps that networks share: those that live at the same time never overlap,
 * and smaller ones are parts of a large one that is idle. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/nn/plan.h"

enum { MAPS = 12, STEPS = 400, MAX = 200000 };

/* A map that is in use, filled with its number. */
struct map {
    float *data;
    size_t count;
    float number;
};

static int map_check(const struct map *m)
{
    for (size_t i = 0; i < m->count; i++)
        if (m->data[i] != m->number)
            return 1;
    return 0;
}

/* Take and give back at random; whatever another map writes is seen. */
static int plan_live_at_once(struct nn_plan *p, struct random *r)
{
    struct map map[MAPS] = {{0}};
    int bad = 0;

    for (int step = 0; step < STEPS && !bad; step++) {
        struct map *m = &map[random_below(r, MAPS)];

        if (m->data) {
            bad = map_check(m);
            nn_plan_recycle(p, m->data);
            m->data = NULL;
            continue;
        }
        m->count = 1 + random_below(r, MAX);
        m->data = nn_plan_map(p, m->count);
        m->number = (float)step;
        bad = !m->data || (uintptr_t)m->data % 64;
        for (size_t i = 0; !bad && i < m->count; i++)
            m->data[i] = m->number;
    }
    for (int i = 0; i < MAPS; i++)
        bad |= map[i].data && map_check(&map[i]);
    return bad;
}

/* Whether the next network's maps lie in the large one of the first. */
static int plan_parts(void)
{
    const struct nn_options opt = {NN_INFER, NN_F32};
    struct nn_pool pool = {0};
    struct nn_plan first, second;
    int bad = 0;

    nn_pool_use(&pool);
    nn_plan_init(&first, opt);
    float *large = nn_plan_map(&first, 4 * MAX);
    bad |= nn_plan_finish(&first, NULL) != 0;
    nn_plan_init(&second, opt);
    for (int i = 0; i < 3; i++) {
        float *part = nn_plan_map(&second, MAX);

        bad |= part < large || part + MAX > large + 4 * MAX;
    }
    bad |= nn_plan_finish(&second, NULL) != 0;
    nn_plan_release(&second);
    nn_plan_init(&second, opt);         /* the parts are one again */
    bad |= nn_plan_map(&second, 4 * MAX) != large;
    bad |= nn_plan_finish(&second, NULL) != 0;
    nn_pool_use(NULL);
    nn_plan_release(&first);
    nn_plan_release(&second);
    nn_pool_release(&pool);
    return bad;
}

static void plan_count(void *times)
{
    ++*(int *)times;
}

/* Whether lists have the plans that began while they were in use, once, and
 * those that do not learn are told of weights from a file alone. */
static int plan_lists(void)
{
    const struct nn_options infer = {NN_INFER, NN_F32};
    struct nn_plans all = {0};
    struct nn_plan plan[3];
    int told[3] = {0};

    nn_plans_use(&all);
    nn_plan_init(&plan[0], (struct nn_options){NN_TRAIN, NN_F32});
    nn_plan_init(&plan[1], infer);
    nn_plan_init(&plan[1], infer);
    nn_plans_use(NULL);
    nn_plan_init(&plan[2], infer);
    for (int i = 0; i < 3; i++)
        nn_plan_layer(&plan[i], (struct nn_layer){&told[i], plan_count, NULL});
    nn_plans_update(&all, false);
    nn_plans_update(&all, true);
    nn_plans_release(&all);
    for (int i = 0; i < 3; i++)
        nn_plan_release(&plan[i]);
    printf("updates of what learns, does not, is not listed: %d, %d, %d\n",
           told[0], told[1], told[2]);
    return told[0] != 2 || told[1] != 1 || told[2] != 0;
}

int main(void)
{
    const struct nn_options opt = {NN_INFER, NN_F32};
    struct nn_pool pool = {0};
    struct nn_plan own, shared;
    struct random r;

    random_init(&r, 1, "maps");
    nn_plan_init(&own, opt);
    nn_pool_use(&pool);
    nn_plan_init(&shared, opt);
    int overlap = plan_live_at_once(&own, &r);
    overlap |= plan_live_at_once(&shared, &r);
    nn_pool_use(NULL);
    nn_plan_release(&own);
    nn_plan_release(&shared);
    nn_pool_release(&pool);
    int apart = plan_parts();
    printf("maps that live at once: %s; maps of the next network: %s\n",
           overlap ? "overlap" : "apart",
           apart ? "memory of their own" : "parts of the first's");
    return plan_lists() || overlap || apart;
}
