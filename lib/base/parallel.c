/* A pool of threads.  A job's items are cut into as many shares as threads may
 * work on it.  Each takes ranges of its own share first, so that the same rows
 * meet the same cache in one job after another, then what is left of the
 * others'.  So a thread that the system has put off holds up no more than the
 * range it is in, and one that never comes nothing at all. */
#include "lib/base/parallel.h"

#include <assert.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "lib/base/cpu.h"
#include "lib/base/processors.h"

#define RANGES 8                /* of a share */
#define SPIN 20e-6              /* seconds before a thread that waits sleeps */

/* What is left of one share; on a cache line of its own. */
struct share {
    _Alignas(64) atomic_size_t next;
    size_t last;
};

struct job {
    parallel_fn *run;
    void *ctx;
    size_t range;               /* items that are taken at once */
    unsigned mode;              /* of the caller, for denormals */
    int shares;
    int joined;                 /* threads that came, with the caller */
    bool open;                  /* in the list: there may be work left */
    bool awaited;               /* the caller sleeps */
    atomic_int inside;          /* threads at work, without the caller */
    struct job *next;
    struct share share[PARALLEL_MAX];
};

static atomic_int width;        /* 0: not yet asked for */
static struct {
    pthread_mutex_t lock;       /* of all below and jobs' joined to awaited */
    pthread_cond_t work, done;
    struct job *jobs;           /* the open ones */
    atomic_int open;            /* how many they are */
    int threads, asleep;
    pthread_t thread[PARALLEL_MAX];
    int caller;                 /* its processor, which they keep off; or -1 */
} pool = {.lock = PTHREAD_MUTEX_INITIALIZER, .work = PTHREAD_COND_INITIALIZER,
          .done = PTHREAD_COND_INITIALIZER, .caller = -1};

static _Thread_local bool alone;    /* shares nothing, or is inside a job */
static _Thread_local int slot;

void parallel_set_width(int threads)
{
    width = threads < PARALLEL_MAX ? threads : PARALLEL_MAX;
}

int parallel_width(void)
{
    int none = 0, allowed;

    if (!width) {
        allowed = processors_allowed();
        atomic_compare_exchange_strong(
            &width, &none, allowed < PARALLEL_MAX ? allowed : PARALLEL_MAX);
    }
    return width;
}

bool parallel_alone(bool yes)
{
    const bool before = alone;

    alone = yes;
    return before;
}

int parallel_threads(void)
{
    return alone ? 1 : parallel_width();
}

size_t parallel_slot(void)
{
    assert(slot < parallel_width());
    return (size_t)slot;
}

/* Wait until *count is zero (or is not), for some microseconds; the processor
 * is given to whoever else wants it. */
static void parallel_spin(atomic_int *count, bool zero)
{
    const double end = cpu_seconds() + SPIN;

    while ((atomic_load(count) == 0) != zero && cpu_seconds() < end)
        for (int i = 0; i < 16; i++)
            cpu_relax();
}

/* As thread number `own` of the job: ranges until none is left. */
static void parallel_work(struct job *j, int own)
{
    const bool was = alone;
    const int before = slot;

    alone = true;
    slot = own;
    for (int k = 0; k < j->shares; k++) {
        struct share *s = &j->share[(own + k) % j->shares];
        size_t at;

        while ((at = atomic_fetch_add(&s->next, j->range)) < s->last)
            for (size_t n = j->range; n && at < s->last; n--)
                j->run(j->ctx, at++);
    }
    alone = was;
    slot = before;
}

/* ---- jobs; the lock is held --------------------------------------------- */

/* Nobody joins it any more. */
static void parallel_close(struct job *j)
{
    struct job **at = &pool.jobs;

    if (!j->open)
        return;
    while (*at != j)
        at = &(*at)->next;
    *at = j->next;
    j->open = false;
    atomic_fetch_sub(&pool.open, 1);
}

/* A job that this thread is part of now, as number *own; or NULL. */
static struct job *parallel_join(int *own)
{
    struct job *j = pool.jobs;

    if (!j)
        return NULL;
    *own = j->joined++;
    atomic_fetch_add(&j->inside, 1);
    if (j->joined == j->shares)
        parallel_close(j);
    return j;
}

/* Its end for this thread: there is no range left.  The job is the caller's
 * again, and may be gone, as soon as nobody is inside. */
static void parallel_leave(struct job *j)
{
    const bool awaited = j->awaited;

    parallel_close(j);
    if (atomic_fetch_sub(&j->inside, 1) == 1 && awaited)
        pthread_cond_broadcast(&pool.done);
}

/* ---- threads ------------------------------------------------------------ */

static void *parallel_run(void *arg)
{
    (void)arg;
    pthread_mutex_lock(&pool.lock);
    for (;;) {
        int own = 0;
        struct job *j = parallel_join(&own);

        if (!j) {
            pool.asleep++;
            pthread_cond_wait(&pool.work, &pool.lock);
            pool.asleep--;
            continue;
        }
        pthread_mutex_unlock(&pool.lock);
        cpu_set_float_mode(j->mode);
        parallel_work(j, own);
        pthread_mutex_lock(&pool.lock);
        parallel_leave(j);
        if (pool.jobs)
            continue;
        pthread_mutex_unlock(&pool.lock);
        parallel_spin(&pool.open, false);
        pthread_mutex_lock(&pool.lock);
    }
    return NULL;
}

/* As many threads as a job of so many shares has use for, if they can be had;
 * signals are for the program's own.  The lock is held. */
static void parallel_start(int shares)
{
    sigset_t all, before;
    pthread_t *thread = &pool.thread[pool.threads];

    if (pool.threads >= shares - 1)
        return;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    while (pool.threads < shares - 1 &&
           !pthread_create(thread, NULL, parallel_run, NULL)) {
        pthread_detach(*thread++);
        pool.threads++;
        pool.caller = -1;
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

/* Whoever is woken must not have to wait until its caller, who is on that processor, is
 * put off; where the caller sleeps (-1) they may be.  The lock is held. */
static void parallel_spread(int caller)
{
    for (int i = 0; caller != pool.caller && i < pool.threads; i++)
        processors_avoid(pool.thread[i], &caller, 1);
    pool.caller = caller;
}

/* ---- callers ------------------------------------------------------------ */

/* Let others join, and wake those that sleep. */
static void parallel_open(struct job *j)
{
    pthread_mutex_lock(&pool.lock);
    parallel_start(j->shares);
    parallel_spread(sched_getcpu());
    j->next = pool.jobs;
    pool.jobs = j;
    atomic_fetch_add(&pool.open, 1);
    for (int i = 1; i < j->shares && i <= pool.asleep; i++)
        pthread_cond_signal(&pool.work);
    pthread_mutex_unlock(&pool.lock);
}

/* Wait for those that are still inside. */
static void parallel_finish(struct job *j)
{
    pthread_mutex_lock(&pool.lock);
    parallel_close(j);
    pthread_mutex_unlock(&pool.lock);
    parallel_spin(&j->inside, true);
    if (atomic_load(&j->inside) == 0)
        return;
    pthread_mutex_lock(&pool.lock);
    j->awaited = true;
    parallel_spread(-1);
    while (atomic_load(&j->inside) > 0)
        pthread_cond_wait(&pool.done, &pool.lock);
    pthread_mutex_unlock(&pool.lock);
}

/* n / m, rounded up. */
static size_t parallel_up(size_t n, size_t m)
{
    return n / m + (n % m != 0);
}

void parallel_for(size_t count, size_t grain, parallel_fn *run, void *ctx)
{
    const size_t max = parallel_up(count, grain ? grain : 1);
    const size_t threads = (size_t)parallel_threads();
    const size_t shares = max < threads ? max : threads;
    struct job j;

    if (shares <= 1) {
        for (size_t i = 0; i < count; i++)
            run(ctx, i);
        return;
    }
    j.run = run;
    j.ctx = ctx;
    j.range = parallel_up(count, shares * RANGES);
    j.range = j.range < grain ? grain : j.range;
    j.mode = cpu_float_mode();
    j.shares = (int)shares;
    j.joined = 1;
    j.open = true;
    j.awaited = false;
    atomic_init(&j.inside, 0);
    for (size_t i = 0; i < shares; i++) {
        atomic_init(&j.share[i].next, count * i / shares);
        j.share[i].last = count * (i + 1) / shares;
    }
    parallel_open(&j);
    parallel_work(&j, 0);
    parallel_finish(&j);
}

struct attempt {
    int (*run)(void *ctx, size_t i, struct error *err);
    void *ctx;
    pthread_mutex_t lock;
    size_t failed;              /* the first so far */
    struct error err;           /* its */
};

/* One item, and its error if it is the first. */
static void parallel_attempt(void *ctx, size_t i)
{
    struct attempt *a = ctx;
    struct error err = {0};

    if (!a->run(a->ctx, i, &err))
        return;
    pthread_mutex_lock(&a->lock);
    if (i < a->failed) {
        a->failed = i;
        a->err = err;
    }
    pthread_mutex_unlock(&a->lock);
}

int parallel_try(size_t count,
                 int (*run)(void *ctx, size_t i, struct error *err), void *ctx,
                 struct error *err)
{
    struct attempt a = {.run = run, .ctx = ctx, .failed = SIZE_MAX,
                        .lock = PTHREAD_MUTEX_INITIALIZER};

    parallel_for(count, 1, parallel_attempt, &a);
    if (a.failed == SIZE_MAX)
        return 0;
    *err = a.err;
    return -1;
}
