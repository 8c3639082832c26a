/* The same stages on narrower instruction sets: the level is chosen once in a
 * process, so the program runs itself again under $SPID_CPU and its rows are
 * read back from their TSV. */
#include "lib/lab/bench/bench.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/cpu.h"

/* Replace this process by the same program on `stage`; the child's part. */
static void levels_exec(const struct bench *b, const char *level,
                        const char *stage)
{
    char seconds[32], threads[16];
    const char *args[] = { "spid-bench", "--tsv", "-j", threads, "-s",
                           seconds, stage, NULL, NULL, NULL };

    snprintf(seconds, sizeof seconds, "%g", b->seconds);
    snprintf(threads, sizeof threads, "%d", b->threads);
    if (b->model) {
        args[6] = "-m";
        args[7] = b->model;
        args[8] = stage;
    }
    setenv("SPID_CPU", level, 1);
    execv("/proc/self/exe", (char *const *)args);
    _exit(127);
}

/* How fast a narrower set is beside this process's own row of the same name:
 * median times. */
static void levels_note_ratio(struct bench *b, const struct bench_row *r,
                              const char *knob)
{
    for (size_t i = 0; i < b->rows; i++) {
        const struct bench_row *own = &b->row[i];

        if (own == r || strcmp(own->stage, r->stage) ||
            strcmp(own->config, r->config) || strcmp(own->knob, knob) ||
            own->threads != r->threads || !(r->ms_median > 0))
            continue;
        bench_note(b, "%s, %s, %s, %d threads: %.2f of %s's speed", r->stage,
                   r->config, r->knob, r->threads,
                   own->ms_median / r->ms_median, cpu_level_name(cpu_level()));
        return;
    }
}

/* A row of the child's report; false when the line is none. */
static bool levels_row(struct bench *b, const char *level, char *line)
{
    char *cell[11];
    struct bench_times t = { 0 };
    char knob[64];
    int n = 0;

    for (char *p = line; n < 10 && (cell[n] = strsep(&p, "\t\n")); n++)
        ;
    if (line[0] == '#' || n < 10 || !strcmp(cell[0], "stage"))
        return true;
    t.min = strtod(cell[4], NULL);
    t.median = strtod(cell[5], NULL);
    t.p95 = strtod(cell[6], NULL);
    snprintf(knob, sizeof knob, "%s: %s", level, cell[2]);
    struct bench_row *r = bench_add(
        b, cell[0], cell[1], knob, atoi(cell[3]), &t,
        strcmp(cell[7], "NA") ? strtod(cell[7], NULL) : (double)NAN,
        strcmp(cell[8], "NA") ? strtod(cell[8], NULL) : (double)NAN);
    if (r)
        levels_note_ratio(b, r, cell[2]);
    return r != NULL;
}

/* All rows of one stage at one level. */
static int levels_stage(struct bench *b, const char *level, const char *stage,
                        struct error *err)
{
    char line[1024];
    int fd[2], status = -1;
    bool ok = true;

    if (pipe(fd))
        return error_set(err, EX_OSERR, "bench: %s", strerror(errno));
    pid_t child = fork();
    if (child == 0) {
        dup2(fd[1], STDOUT_FILENO);
        close(fd[0]);
        close(fd[1]);
        levels_exec(b, level, stage);
    }
    close(fd[1]);
    FILE *f = fdopen(fd[0], "r");
    while (f && fgets(line, sizeof line, f))
        ok = levels_row(b, level, line) && ok;
    if (f)
        fclose(f);
    else
        close(fd[0]);
    if (child < 0 || waitpid(child, &status, 0) < 0 || status || !f || !ok)
        return error_set(err, EX_OSERR, "bench: %s on %s did not finish",
                         stage, level);
    return 0;
}

int bench_levels(struct bench *b, const char *stage, struct error *err)
{
    const size_t first = b->rows;

    for (int i = (int)cpu_level() - 1; i >= 0; i--)
        if (levels_stage(b, cpu_level_name((enum cpu_level)i), stage, err))
            return -1;
    if (b->rows > first)
        bench_note(b, "%s: rows that name an instruction set have their "
                   "errors against the same set's truth", stage);
    return 0;
}
