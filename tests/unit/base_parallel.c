/* The pool: every item once, each thread in a slot of its own, several callers
 * at once, calls inside a job, callers that work alone, denormals, and the
 * processors that are kept for callers while they work. */
#include "lib/base/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>
#include <sys/resource.h>

#include "lib/base/cpu.h"
#include "tests/check.h"

#define MAX 5000

struct count {
    atomic_uchar seen[MAX];
    atomic_int busy[PARALLEL_MAX];     /* slots in use */
    atomic_int bad;
    bool nested;
    atomic_int kept;            /* items whose denormals were not flushed */
};

static void count_inner(void *ctx, size_t i)
{
    atomic_int *n = ctx;

    atomic_fetch_add(n, (int)i);
}

static void count_part(void *ctx, size_t i)
{
    struct count *c = ctx;
    const size_t own = parallel_slot();
    volatile float tiny = 1e-39f;

    c->bad += atomic_fetch_add(&c->busy[own], 1) != 0;
    c->seen[i]++;
    c->kept += tiny * 0.5f != 0;
    if (c->nested) {
        atomic_int n = 0;

        parallel_for(100, 1, count_inner, &n);
        c->bad += n != 4950 || parallel_slot() != own;
    }
    atomic_fetch_sub(&c->busy[own], 1);
}

/* One job; how many items were not seen exactly once, and what else failed. */
static int count_run(struct count *c, size_t count, size_t grain, bool nested)
{
    int bad;

    memset(c, 0, sizeof *c);
    c->nested = nested;
    parallel_for(count, grain, count_part, c);
    bad = c->bad;
    for (size_t i = 0; i < MAX; i++)
        bad += c->seen[i] != (i < count);
    return bad;
}

/* A thread with jobs of its own. */
static void *count_thread(void *arg)
{
    static _Thread_local struct count c;
    int *bad = arg;

    for (size_t i = 0; i < 300; i++)
        *bad += count_run(&c, i * 7 % 200, 1 + i % 3, i % 5 == 0);
    return NULL;
}

static struct count count;

/* All counts of threads, sizes about the corners. */
static void sizes_run(void)
{
    static const int widths[] = {1, 2, 3, 7, PARALLEL_MAX};
    static const size_t sizes[] = {0, 1, 2, 3, 7, 64, 65, 1000, MAX};
    int bad = 0;

    for (int w = 0; w < 5; w++) {
        parallel_set_width(widths[w]);
        for (int s = 0; s < 9; s++)
            for (size_t grain = 0; grain < 40; grain += 13)
                bad += count_run(&count, sizes[s], grain, s % 2);
    }
    expect("items not seen once, or slots shared", bad, 0, 0);
}

/* How many processors a pool's thread may be on: when it begins, and when they are
 * more, as its caller waits for it, or after two seconds. */
struct held {
    pthread_t caller;
    atomic_int inside;
    int begun, waited;
};

static int held_processors(void)
{
    cpu_set_t mask;

    sched_getaffinity(0, sizeof mask, &mask);
    return CPU_COUNT(&mask);
}

static void held_part(void *ctx, size_t i)
{
    struct held *h = ctx;
    const bool pool = !pthread_equal(pthread_self(), h->caller);
    const double end = cpu_seconds() + 2;

    (void)i;
    if (pool)
        h->begun = h->waited = held_processors();
    atomic_fetch_add(&h->inside, 1);
    while (h->inside < 2 && cpu_seconds() < end)
        sched_yield();
    while (pool && h->waited == h->begun && cpu_seconds() < end)
        h->waited = held_processors();
}

/* A thread keeps off its caller's processor, until the caller sleeps. */
static void held_run(void)
{
    struct held h = {.caller = pthread_self()};
    const int all = held_processors();

    if (all < 2 || getpriority(PRIO_PROCESS, 0) > 0)
        return;
    parallel_set_width(2);
    for (int i = 0; i < 50 && !h.begun; i++) {
        h.inside = 0;
        parallel_for(2, 1, held_part, &h);
    }
    expect("off its caller's processor", h.begun, all - 1, 0);
    expect("anywhere while that sleeps", h.waited, all, 0);
}

int main(void)
{
    pthread_t thread[4];
    int bad[4] = {0};

    expect("slot outside", (double)parallel_slot(), 0, 0);
    held_run();
    sizes_run();
    parallel_set_width(3);
    for (int i = 0; i < 4; i++)
        pthread_create(&thread[i], NULL, count_thread, &bad[i]);
    for (int i = 0; i < 4; i++)
        pthread_join(thread[i], NULL);
    expect("the same for four callers at once",
           bad[0] + bad[1] + bad[2] + bad[3], 0, 0);
#if defined(__x86_64__) || defined(__aarch64__)
    cpu_flush_denormals();
    for (int i = 0, n = 0; i < 200; i++, n += count.kept) {
        count_run(&count, MAX, 1, false);
        if (i == 199)
            expect("items that keep denormals", n, 0, 0);
    }
    cpu_keep_denormals();
    count_run(&count, MAX, 1, false);
    check_that("and all keep them when the caller does", count.kept == MAX);
#endif
    parallel_alone(true);
    count_run(&count, MAX, 1, false);
    expect("alone: all of it", count.kept, MAX, 0);
    return check_status();
}
