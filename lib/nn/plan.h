/* A plan: the memory of one network, and the first thing that went wrong
 * while its layers were being planned (one check at the end, not one per
 * layer).  Layers keep a pointer to it; it lives as long as they do. */
#ifndef SPID_NN_PLAN_H
#define SPID_NN_PLAN_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/nn/nn.h"

/* Sums over threads are made from this many parts, whatever the number of
 * threads, and added in order: the same bits for any -j. */
#define NN_PARTS 4
/* The same for sums over rows of cheap kernels. */
#define NN_SUMS 16

struct nn_chunk {
    void *data;
    size_t size;
    size_t pages;               /* bytes of pages_alloc; 0: of the heap */
    bool idle;
    bool rest;                  /* of the memory that the chunk before it
                                 * begins */
};

/* Buffers of a plan; or maps that plans share whose networks never run at the
 * same time.  Zeroed: empty. */
struct nn_pool {
    struct nn_chunk *chunk;
    size_t chunks, room;
};

/* What a layer does when the weights in ps have changed, and to free what the
 * plan's memory does not hold; either may be NULL. */
struct nn_layer {
    void *layer;
    void (*update)(void *layer), (*release)(void *layer);
};

struct nn_plan {
    struct nn_options opt;
    struct error err;              /* code 0: all well so far */
    struct nn_layer *layer;        /* in the order of planning */
    size_t layers;
    struct nn_pool own;
    struct nn_pool *shared;        /* where maps come from; NULL: own */
    size_t scratch_size;           /* wanted so far */
    struct nn_chunk working;
    char *scratch;                 /* working's bytes, shared by all layers,
                                    * one at a time */
};

/* The plans for inference that this thread begins from here on take their maps
 * from the pool, which outlives them; NULL: from memory of their own again.
 * Whoever shares a pool runs one after another, and keeps nothing in a map
 * between two passes. */
void nn_pool_use(struct nn_pool *pool);
/* Free what it holds; zeroed then. */
void nn_pool_release(struct nn_pool *pool);

/* The plans of networks whose weights change.  Zeroed: none. */
struct nn_plans {
    struct nn_plan **plan;
    size_t count, room;
};

/* The plans that this thread begins from here on are listed there; NULL:
 * nowhere. */
void nn_plans_use(struct nn_plans *plans);
/* The weights changed: layers fold and reorder them.  loaded: of all networks,
 * else of those that learn, which are planned with a backward. */
void nn_plans_update(const struct nn_plans *plans, bool loaded);
/* Forget them; zeroed then. */
void nn_plans_release(struct nn_plans *plans);

/* An empty plan; NN_F32 or NN_BF16, unless NN_INFER. */
void nn_plan_init(struct nn_plan *p, struct nn_options opt);
/* Free all its buffers and what its layers hold; before these go. */
void nn_plan_release(struct nn_plan *p);

/* A zero-filled buffer, aligned to 64 bytes, owned by the plan, of its own:
 * for weights and whatever else must last from pass to pass.  NULL after a
 * failure (which the plan remembers). */
void *nn_plan_bytes(struct nn_plan *p, size_t bytes);
/* The same, counted in floats. */
float *nn_plan_floats(struct nn_plan *p, size_t count);

/* A buffer for one pass, activations or gradients, with anything in it.  It may
 * have been another layer's before, given back. */
float *nn_plan_map(struct nn_plan *p, size_t count);
/* The map's content is dead from here on in the order of planning.  Only
 * inference gives anything back. */
void nn_plan_recycle(struct nn_plan *p, void *map);
/* The same in any plan: of gradients, planned after all maps. */
void nn_plan_reuse(struct nn_plan *p, void *map);
/* Some layer needs this much scratch while it runs. */
void nn_plan_scratch(struct nn_plan *p, size_t bytes);
/* Remember a failure; the first one stays. */
void nn_plan_fail(struct nn_plan *p, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* One more layer with weights; released at once where the plan fails. */
void nn_plan_layer(struct nn_plan *p, struct nn_layer l);
/* All layers are planned: allocate the scratch and let them take their weights;
 * -1 with the first failure. */
int nn_plan_finish(struct nn_plan *p, struct error *err);

/* Whether layers keep what their backward needs. */
static inline bool nn_plan_backward(const struct nn_plan *p)
{
    return p->opt.mode != NN_INFER;
}

/* The type of layers that know only one type when they learn: float. */
static inline enum nn_type nn_plan_type(const struct nn_plan *p)
{
    return nn_plan_backward(p) ? NN_F32 : p->opt.type;
}

#endif
