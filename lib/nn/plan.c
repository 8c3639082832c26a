/* Memory and options of a planned network: buffers that live as long as it,
 * maps that layers pass on to each other, one scratch for all. */
#include "lib/nn/plan.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/base/pages.h"

int nn_type_parse(enum nn_type *type, const char *word)
{
    for (int i = NN_F32; i <= NN_INT8; i++)
        if (!strcmp(word, nn_type_name((enum nn_type)i))) {
            *type = (enum nn_type)i;
            return 0;
        }
    return -1;
}

const char *nn_type_name(enum nn_type type)
{
    static const char *const name[] = { [NN_F32] = "f32", [NN_BF16] = "bf16",
                                        [NN_FAST] = "fast",
                                        [NN_INT8] = "int8" };

    return name[type];
}

#define SPLIT 65536              /* bytes; fewer are not split off */

/* ---- chunks ------------------------------------------------------------ */

/* From the heap, not cleared. */
static struct nn_chunk plan_chunk_of_heap(size_t bytes)
{
    const size_t size = (bytes + 63) & ~(size_t)63;

    return (struct nn_chunk){
        .data = bytes > SIZE_MAX - 63 ? NULL : aligned_alloc(64, size),
        .size = bytes
    };
}

/* Zeros, in huge pages. */
static struct nn_chunk plan_chunk_of_zeros(size_t bytes)
{
    return (struct nn_chunk){
        .data = pages_alloc(bytes), .size = bytes, .pages = bytes
    };
}

static void plan_chunk_release(struct nn_chunk *c)
{
    if (c->pages)
        pages_free(c->data, c->pages);
    else if (!c->rest)
        free(c->data);
    memset(c, 0, sizeof *c);
}

/* ---- pools ------------------------------------------------------------- */

static _Thread_local struct nn_pool *plan_pool_in_use;

void nn_pool_use(struct nn_pool *pool)
{
    plan_pool_in_use = pool;
}

/* One more chunk, number `at`; -1 without memory for its line. */
static int plan_pool_insert(struct nn_pool *pool, size_t at, struct nn_chunk c)
{
    if (!list_add(&pool->chunk, &pool->chunks, &pool->room, sizeof c, NULL))
        return -1;
    memmove(pool->chunk + at + 1, pool->chunk + at,
            (pool->chunks - 1 - at) * sizeof c);
    pool->chunk[at] = c;
    return 0;
}

/* Keep `bytes` of an idle chunk; what is left of it is the next one, idle, if
 * that is worth a line. */
static void plan_pool_split(struct nn_pool *pool, size_t i, size_t bytes)
{
    struct nn_chunk *c = &pool->chunk[i];
    const size_t kept = (bytes + 63) & ~(size_t)63;

    if (c->size < kept + SPLIT)
        return;
    const struct nn_chunk left = {.data = (char *)c->data + kept,
                                  .size = c->size - kept, .idle = true,
                                  .rest = true};
    if (plan_pool_insert(pool, i + 1, left) == 0)
        pool->chunk[i].size = kept;
}

/* Idle neighbours of one memory become one chunk. */
static void plan_pool_join(struct nn_pool *pool)
{
    size_t n = 0;

    for (size_t i = 0; i < pool->chunks; i++) {
        struct nn_chunk *last = n ? &pool->chunk[n - 1] : NULL;
        const struct nn_chunk c = pool->chunk[i];

        if (c.rest && c.idle && last->idle)
            last->size += c.size;
        else
            pool->chunk[n++] = c;
    }
    pool->chunks = n;
}

/* So many bytes of the smallest idle chunk that is large enough; or NULL. */
static void *plan_pool_reuse(struct nn_pool *pool, size_t bytes)
{
    size_t best = SIZE_MAX;

    for (size_t i = 0; i < pool->chunks; i++) {
        const struct nn_chunk *c = &pool->chunk[i];

        if (c->idle && c->size >= bytes &&
            (best == SIZE_MAX || c->size < pool->chunk[best].size))
            best = i;
    }
    if (best == SIZE_MAX)
        return NULL;
    plan_pool_split(pool, best, bytes);
    pool->chunk[best].idle = false;
    return pool->chunk[best].data;
}

void nn_pool_release(struct nn_pool *pool)
{
    for (size_t i = 0; i < pool->chunks; i++)
        plan_chunk_release(&pool->chunk[i]);
    free(pool->chunk);
    memset(pool, 0, sizeof *pool);
}

/* ---- lists of plans ---------------------------------------------------- */

static _Thread_local struct nn_plans *plans_in_use;

void nn_plans_use(struct nn_plans *plans)
{
    plans_in_use = plans;
}

/* A plan may begin anew. */
static void nn_plans_add(struct nn_plans *all, struct nn_plan *p)
{
    struct nn_plan **to;

    for (size_t i = 0; i < all->count; i++)
        if (all->plan[i] == p)
            return;
    to = list_add(&all->plan, &all->count, &all->room, sizeof *to, NULL);
    if (to)
        *to = p;
    else
        nn_plan_fail(p, EX_OSERR, "out of memory");
}

/* Every layer takes its weights. */
static void nn_plan_update(struct nn_plan *p)
{
    for (size_t i = 0; i < p->layers; i++)
        if (p->layer[i].update)
            p->layer[i].update(p->layer[i].layer);
}

void nn_plans_update(const struct nn_plans *plans, bool loaded)
{
    for (size_t i = 0; i < plans->count; i++)
        if (loaded || nn_plan_backward(plans->plan[i]))
            nn_plan_update(plans->plan[i]);
}

void nn_plans_release(struct nn_plans *plans)
{
    free(plans->plan);
    memset(plans, 0, sizeof *plans);
}

/* ---- plans ------------------------------------------------------------- */

void nn_plan_init(struct nn_plan *p, struct nn_options opt)
{
    memset(p, 0, sizeof *p);
    p->opt = opt;
    p->shared = opt.mode == NN_INFER ? plan_pool_in_use : NULL;
    if (opt.type != NN_F32 && opt.type != NN_BF16 && opt.mode != NN_INFER)
        nn_plan_fail(p, EX_SOFTWARE, "%s is for inference only",
                     nn_type_name(opt.type));
    if (plans_in_use)
        nn_plans_add(plans_in_use, p);
}

void nn_plan_release(struct nn_plan *p)
{
    for (size_t i = 0; i < p->layers; i++)
        if (p->layer[i].release)
            p->layer[i].release(p->layer[i].layer);
    free(p->layer);
    nn_pool_release(&p->own);
    plan_chunk_release(&p->working);
    memset(p, 0, sizeof *p);
}

void nn_plan_fail(struct nn_plan *p, int code, const char *format, ...)
{
    if (p->err.code)
        return;
    va_list ap;
    va_start(ap, format);
    vsnprintf(p->err.text, sizeof p->err.text, format, ap);
    va_end(ap);
    p->err.code = code;
}

/* One more chunk of the pool; its bytes. */
static void *nn_plan_take(struct nn_plan *p, struct nn_pool *pool,
                          size_t bytes)
{
    struct nn_chunk c = {0};

    if (p->err.code)
        return NULL;
    bytes = bytes ? bytes : 64;
    c = pool == &p->own ? plan_chunk_of_zeros(bytes)
                        : plan_chunk_of_heap(bytes);
    if (c.data && !plan_pool_insert(pool, pool->chunks, c))
        return c.data;
    plan_chunk_release(&c);
    nn_plan_fail(p, EX_OSERR, "out of memory (%zu bytes more)", bytes);
    return NULL;
}

void *nn_plan_bytes(struct nn_plan *p, size_t bytes)
{
    return nn_plan_take(p, &p->own, bytes);
}

float *nn_plan_floats(struct nn_plan *p, size_t count)
{
    return nn_plan_bytes(p, count * sizeof(float));
}

/* Where its maps come from. */
static struct nn_pool *nn_plan_maps(struct nn_plan *p)
{
    return p->shared ? p->shared : &p->own;
}

float *nn_plan_map(struct nn_plan *p, size_t count)
{
    size_t bytes = count * sizeof(float);
    float *map = p->err.code ? NULL : plan_pool_reuse(nn_plan_maps(p), bytes);

    return map ? map : nn_plan_take(p, nn_plan_maps(p), bytes);
}

void nn_plan_recycle(struct nn_plan *p, void *map)
{
    if (!nn_plan_backward(p))
        nn_plan_reuse(p, map);
}

void nn_plan_reuse(struct nn_plan *p, void *map)
{
    struct nn_pool *pool = nn_plan_maps(p);

    for (size_t i = 0; i < pool->chunks; i++)
        if (pool->chunk[i].data == map)
            pool->chunk[i].idle = true;
    plan_pool_join(pool);
}

void nn_plan_scratch(struct nn_plan *p, size_t bytes)
{
    if (bytes > p->scratch_size)
        p->scratch_size = bytes;
}

void nn_plan_layer(struct nn_plan *p, struct nn_layer l)
{
    void *grown = p->err.code ? NULL
                : realloc(p->layer, (p->layers + 1) * sizeof *p->layer);

    if (grown) {
        p->layer = grown;
        p->layer[p->layers++] = l;
        return;
    }
    if (l.release)
        l.release(l.layer);
    nn_plan_fail(p, EX_OSERR, "out of memory");
}

int nn_plan_finish(struct nn_plan *p, struct error *err)
{
    for (size_t i = 0; p->shared && i < p->shared->chunks; i++)
        p->shared->chunk[i].idle = true;    /* the next network's turn */
    if (p->shared)
        plan_pool_join(p->shared);
    if (!p->err.code) {
        plan_chunk_release(&p->working);
        p->working = plan_chunk_of_zeros(p->scratch_size + 64);
        p->scratch = p->working.data;
        if (!p->scratch)
            nn_plan_fail(p, EX_OSERR, "out of memory (%zu bytes of scratch)",
                         p->scratch_size);
    }
    if (p->err.code) {
        if (err)
            *err = p->err;
        return -1;
    }
    nn_plan_update(p);
    return 0;
}
