/* Training steps as spid-train makes them, of the motion encoder and of the
 * whole system, on a few people of spid-synth. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/file.h"
#include "lib/base/parallel.h"
#include "lib/lab/bench/bench_avatar.h"
#include "lib/lab/train/adam.h"
#include "lib/lab/train/task.h"

#define PEOPLE "3"

static const struct training {
    const char *name, *config;
} trainings[] = {
    {"motion encoder, batch 8, f32",
     "{\"stage\":\"motion\",\"batch\":8,\"micro\":8,\"pool\":" PEOPLE "}"},
    {"system, 256x256, batch 2, bf16",
     "{\"stage\":\"all\",\"batch\":2,\"micro\":1,\"image\":256,"
     "\"pool\":" PEOPLE "}"}
};

struct course {
    struct train_config config;
    struct task task;
    struct data_reader *reader;
    struct data_pool pool;
    struct adam adam;
    uint64_t step;
};

/* One step. */
static int bench_call_step(void *context, struct error *err)
{
    struct course *c = context;
    struct task *t = &c->task;
    double parts[TASK_PARTS] = {0};

    memset(t->ps.g, 0, t->ps.total * sizeof *t->ps.g);
    for (int64_t k = 0; k < c->config.batch / c->config.micro; k++)
        if (t->type->pass(t, parts, c->step, (size_t)k, err))
            return -1;
    adam_update(&c->adam, &t->ps, c->config.rate, adam_norm(&t->ps));
    nn_plans_update(&t->plans, false);
    c->step++;
    return 0;
}

/* The row of one training on the people of a file. */
static int bench_training(struct bench *b, const struct training *t,
                          const struct head *head, const char *people,
                          struct error *err)
{
    struct course c = {0};
    struct bench_times times;
    int rc = -1;

    if (train_config_parse(&c.config, t->config, "bench", err))
        return -1;
    if (!task_init(&c.task, &c.config, head, err)
        && (c.reader = data_open(&people, 1, c.task.type->margin, err))
        && !data_pool_init(&c.pool, c.reader, (size_t)c.config.pool, 0, err)
        && !adam_init(&c.adam, &c.task.ps, c.config.clip, 0, err)) {
        c.task.pool = &c.pool;
        rc = bench_time(&times, b->seconds / 2, 3, bench_call_step, &c, err);
    }
    if (rc == 0) {
        bench_add(b, "train", t->name, "step", b->threads, &times, NAN, NAN);
        bench_note(b, "train: %s: %.2f pictures a second", t->name,
                   (double)c.config.batch / times.median * 1e3);
    }
    adam_release(&c.adam);
    data_pool_release(&c.pool);
    data_close(c.reader);
    task_release(&c.task);
    train_config_release(&c.config);
    return rc;
}

/* People with their truth into a file, by spid-synth beside this program. */
static int bench_make_people(const struct bench *b, const char *path,
                             struct error *err)
{
    char program[FILE_TEMPORARY + 16];
    int status = -1;

    file_own_folder(program, FILE_TEMPORARY);
    strcat(program, "spid-synth");
    const pid_t child = fork();

    if (child == 0) {
        execl(program, program, "-q", "-n", PEOPLE, "--frames", "4", "--head",
              b->head, "-o", path, NULL);
        _exit(127);
    }
    if (child < 0 || waitpid(child, &status, 0) != child || status)
        return error_set(err, EX_SOFTWARE, "%s failed", program);
    return 0;
}

int bench_train(struct bench *b, struct error *err)
{
    char dir[FILE_TEMPORARY], path[FILE_TEMPORARY + 16];
    struct head head = {0};
    int rc = -1;

    if (!b->head)
        return error_set(err, EX_NOINPUT, "no head model (expected --head)");
    if (bench_folder(dir, err))
        return -1;
    snprintf(path, sizeof path, "%s/people", dir);
    parallel_set_width(b->threads);
    if (!bench_make_people(b, path, err) && !head_load(&head, b->head, err))
        rc = bench_training(b, &trainings[0], &head, path, err)
             || bench_training(b, &trainings[1], &head, path, err) ? -1 : 0;
    head_release(&head);
    unlink(path);
    rmdir(dir);
    return rc;
}
