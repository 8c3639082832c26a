/* The list of steps, its plan and its passes. */
#include "lib/nn/tape.h"

#include <assert.h>
#include <string.h>
#include <sysexits.h>

#include "lib/nn/image.h"

/* ---- the list ------------------------------------------------------------- */

void tape_init(struct tape *t, struct params *ps, size_t channels, bool frozen)
{
    *t = (struct tape){.ps = ps, .frozen = frozen, .count = 1,
                       .picture.channels = channels};
    t->map[0] = &t->picture;
}

void tape_release(struct tape *t)
{
    nn_plan_release(&t->plan);
    arena_release(&t->memory);
    memset(t, 0, sizeof *t);
}

int tape_step(struct tape *t, const struct tape_op *op, const int *of, int n)
{
    struct tape_step *s = arena_take(&t->memory, 1, sizeof *s);
    void *layer = arena_take(&t->memory, op->size, 1);

    assert(op->size <= sizeof t->spare && n >= 0 && n <= TAPE_READS);
    if (!s || !layer || t->count == TAPE_MAPS) {
        t->memory.failed = true;
        t->picture.layer = t->spare;
        return 0;
    }
    *s = (struct tape_step){.op = op, .layer = layer, .number = t->count,
                            .reads = n};
    for (int k = 0; k < n; k++) {
        s->of[k] = t->map[of[k]];
        s->of[k]->readers++;
    }
    s->channels = n ? s->of[0]->channels : 0;
    t->map[t->count] = s;
    return t->count++;
}

size_t tape_channels(const struct tape *t, int map)
{
    return t->map[map]->channels;
}

int tape_keep(struct tape *t, int map)
{
    t->map[map]->readers++;     /* one that is never planned */
    return map;
}

void tape_constant(struct tape *t, int map)
{
    for (int i = 0; i <= map; i++)
        t->map[i]->constant = true;
}

size_t tape_count(const struct tape_step *s)
{
    return s->batch * s->h * s->w * s->channels;
}

/* ---- planning ------------------------------------------------------------- */

/* Its map: where one that it reads lies, if nobody else wants that, or one of
 * its own. */
static void tape_plan_map(struct tape_step *s, const struct tape *t,
                          struct nn_plan *p)
{
    const int place = s->op->in_place;
    struct tape_step *on = place ? s->of[place - 1] : NULL;

    if (on && (nn_plan_backward(p) || on == &t->picture || on->left != 1))
        on = NULL;
    s->x = s->out = on ? on->out : nn_plan_map(p, tape_count(s));
    for (int k = 0; k < s->reads; k++) {
        struct tape_step *a = s->of[k];

        if (--a->left == 0 && a != &t->picture && a != on)
            nn_plan_recycle(p, a->out);
    }
}

static void tape_plan_step(struct tape_step *s, const struct tape *t,
                           struct nn_plan *p)
{
    const struct tape_step *a = s->reads ? s->of[0] : &t->picture;

    s->batch = a->batch;
    s->h = a->h;
    s->w = a->w;
    s->left = s->readers;
    if (s->op->plan)
        s->op->plan(s, p);
    tape_plan_map(s, t, p);
}

/* Gradients, each from its first reader's backward to its own. */
static void tape_plan_gradients(struct tape *t, struct nn_plan *p)
{
    size_t max = tape_count(&t->picture);

    for (int i = t->count - 1; i > 0; i--)
        t->map[i]->d = NULL;
    for (int i = t->count - 1; i > 0; i--) {
        struct tape_step *s = t->map[i];

        for (int k = -1; k < s->reads; k++) {
            struct tape_step *a = k < 0 ? s : s->of[k];

            if (a != &t->picture && !a->constant && !a->d)
                a->d = nn_plan_map(p, tape_count(a));
        }
        if (s->d)
            nn_plan_reuse(p, s->d);
        max = tape_count(s) > max ? tape_count(s) : max;
    }
    t->part = nn_plan_floats(p, max);
}

int tape_plan(struct tape *t, size_t batch, size_t h, size_t w,
              struct nn_options opt, struct error *err)
{
    struct nn_plan *p = &t->plan;

    nn_plan_release(p);
    nn_plan_init(p, opt);
    if (arena_check(&t->memory, "a network", err))
        return -1;
    t->picture.batch = batch;
    t->picture.h = h;
    t->picture.w = w;
    t->picture.left = t->picture.readers;
    for (int i = 1; i < t->count; i++)
        tape_plan_step(t->map[i], t, p);
    if (nn_plan_backward(p))
        tape_plan_gradients(t, p);
    return nn_plan_finish(p, err);
}

/* ---- passes --------------------------------------------------------------- */

void tape_forward(float *last, const float *picture, struct tape *t)
{
    struct tape_step *end = t->map[t->count - 1];

    t->picture.x = picture;
    if (last)
        end->x = end->out = last;
    for (int i = 1; i < t->count; i++)
        t->map[i]->op->forward(t->map[i]);
}

const float *tape_map(size_t shape[4], const struct tape *t, int map)
{
    const struct tape_step *s = t->map[map];

    if (shape) {
        shape[0] = s->batch;
        shape[1] = s->h;
        shape[2] = s->w;
        shape[3] = s->channels;
    }
    return s->x;
}

/* d, n values, is one more part of a's gradient. */
static void tape_receive(struct tape_step *a, const float *d)
{
    if (a->begun)
        image_add(a->d, d, tape_count(a));
    else if (a->d != d)
        memcpy(a->d, d, tape_count(a) * sizeof *d);
    a->begun = true;
}

/* The gradients of what it reads. */
static void tape_backward_step(struct tape *t, struct tape_step *s)
{
    if (s->reads == 0)
        s->op->backward(NULL, s, 0);
    for (int k = s->reads; k-- > 0;) {
        struct tape_step *a = s->of[k];
        float *to = a->d && a->begun ? t->part : a->d;  /* NULL: constant */

        if (to || s->op->learns)
            s->op->backward(to, s, k);
        if (to)
            tape_receive(a, to);
    }
}

void tape_backward(float *dpicture, const struct tape_seed *seed, size_t n,
                   struct tape *t)
{
    for (int i = 0; i < t->count; i++)
        t->map[i]->begun = false;
    t->picture.d = dpicture;
    for (int i = t->count - 1; i > 0; i--) {
        for (size_t j = 0; j < n; j++)
            if (seed[j].map == i && seed[j].d)
                tape_receive(t->map[i], seed[j].d);
        if (t->map[i]->begun)
            tape_backward_step(t, t->map[i]);
    }
    if (dpicture && !t->picture.begun)
        memset(dpicture, 0, tape_count(&t->picture) * sizeof *dpicture);
}

int tape_graph(struct graph *g, int x, int from, int last,
               const struct tape *t)
{
    int value[TAPE_MAPS], in[TAPE_READS];

    value[from] = x;
    for (int i = from + 1; i <= last; i++) {
        const struct tape_step *s = t->map[i];

        for (int k = 0; k < s->reads; k++)
            in[k] = value[s->of[k]->number];
        if (s->op->graph)
            x = s->op->graph(g, in, s);
        else
            graph_fail(g, EX_CONFIG, "a layer has no ONNX form here");
        value[i] = x;
    }
    return x;
}
