/* Work shared by threads: one pool for the whole process, whose threads sleep
 * while there is nothing to do and are never waited for unless they have begun.
 * How many there are is one count, taken once and the same for all that is
 * planned, in whichever thread. */
#ifndef SPID_BASE_PARALLEL_H
#define SPID_BASE_PARALLEL_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

#define PARALLEL_MAX 64        /* threads */

/* Set the count (at most PARALLEL_MAX), before anything is planned; what was
 * planned with a smaller one must not be run any more. */
void parallel_set_width(int threads);

/* The count: what was set, or processors_allowed().  Room for one part a thread
 * is sized by it. */
int parallel_width(void);

/* Work on item i; ctx is the caller's. */
typedef void parallel_fn(void *ctx, size_t i);

/* Call run for every i in [0, count), on this thread and others that are free,
 * `grain` or more items at once to each; returns when all is done.  Who does
 * what, and when, is different every time: no result may depend on it.  Any
 * thread may call it; inside run, and after parallel_alone, the caller does it
 * all, as it does where there are no other threads: it never fails.  All treat
 * denormals as the caller does. */
void parallel_for(size_t count, size_t grain, parallel_fn *run, void *ctx);

/* The same, one item at a time, for work that can fail: 0, or -1 with the error
 * of the first item (by number) that failed; all are tried. */
int parallel_try(size_t count,
                 int (*run)(void *ctx, size_t i, struct error *err), void *ctx,
                 struct error *err);

/* Work on item i with arguments of its own, each a type and a name:
 *
 *     PARALLEL(pool_row, y, float *, out, const float *, in, size_t, width)
 *     {
 *         ... row y of out
 *     }
 *
 * defines struct pool_row of the arguments, and pool_row for parallel_for with
 * one as its ctx.  parallel_each(pool_row, height, 1, out, in, width) makes one
 * and calls parallel_for. */
#define PARALLEL(name, i, ...) \
    struct name { PARALLEL_LIST(PARALLEL_MEMBER, __VA_ARGS__) }; \
    static void name##_item(size_t i \
                            PARALLEL_LIST(PARALLEL_NAMED, __VA_ARGS__)); \
    static void name(void *ctx, size_t item) \
    { \
        const struct name *own = ctx; \
        name##_item(item PARALLEL_LIST(PARALLEL_VALUE, __VA_ARGS__)); \
    } \
    static void name##_item(size_t i PARALLEL_LIST(PARALLEL_NAMED, __VA_ARGS__))
#define parallel_each(name, count, grain, ...) \
    parallel_for(count, grain, name, &(struct name){ __VA_ARGS__ })

#define PARALLEL_MEMBER(type, name) type name;
#define PARALLEL_NAMED(type, name) , type name
#define PARALLEL_VALUE(type, name) , own->name

/* f(type, name) of each pair, at most 12: a macro does not expand itself, but
 * what is left of it is expanded when it is read again. */
#define PARALLEL_LIST(f, ...) PARALLEL_READ(PARALLEL_PAIR(f, __VA_ARGS__))
#define PARALLEL_PAIR(f, type, name, ...) \
    f(type, name) __VA_OPT__(PARALLEL_MORE PARALLEL_CALL (f, __VA_ARGS__))
#define PARALLEL_MORE() PARALLEL_PAIR
#define PARALLEL_CALL ()
#define PARALLEL_READ(...) PARALLEL_4(PARALLEL_4(PARALLEL_4(__VA_ARGS__)))
#define PARALLEL_4(...) PARALLEL_2(PARALLEL_2(__VA_ARGS__))
#define PARALLEL_2(...) PARALLEL_1(PARALLEL_1(__VA_ARGS__))
#define PARALLEL_1(...) __VA_ARGS__

/* Whether the calling thread shares no work from now on, since it is one of
 * several that each have their own; returns what held before. */
bool parallel_alone(bool yes);

/* How many threads at most work on what the calling one shares. */
int parallel_threads(void);

/* Inside run: which of parallel_width() parts of some room is this thread's
 * alone until run returns.  Elsewhere 0. */
size_t parallel_slot(void);

#endif
