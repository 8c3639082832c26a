/* How many threads a program uses, and how they wait, alone and beside the
 * other programs of a pipe. */
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cmd/cli_parts.h"
#include "lib/base/parallel.h"
#include "lib/base/processors.h"

static bool threads_given;     /* by -j or OMP_NUM_THREADS */

void cli_use_threads(long wanted)
{
    const bool environment = getenv("OMP_NUM_THREADS") != NULL;

    if (wanted)
        cli.threads = (int)wanted;
    else if (environment)
        cli.threads = omp_get_max_threads();
    else
        cli.threads = processors_allowed();
    threads_given = wanted || environment;
    parallel_set_width(cli.threads);
}

/* Is fd one end of a pipe? */
static bool cli_is_pipe(int fd)
{
    struct stat st;

    return fstat(fd, &st) == 0 && S_ISFIFO(st.st_mode);
}

/* OpenMP's threads wait for each other by spinning for milliseconds, which
 * keeps processors from the work that is waited for.  The library reads how to
 * wait before main begins; so the program starts again with the variable set,
 * unless the user has set one. */
static void cli_start_again(char **argv, const char *name,
                            const char *value)
{
    char path[4096];
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 1);

    if (n <= 0 || getenv("OMP_WAIT_POLICY") || getenv("GOMP_SPINCOUNT") ||
        setenv(name, value, 0))
        return;
    path[n] = 0;
    execv(path, argv);         /* if it fails: slower, not wrong */
}

/* The programs of a pipe share the processors; with threads that spin they run
 * at a third of their speed. */
static void cli_wait_asleep(char **argv)
{
    if (cli_is_pipe(STDIN_FILENO) || cli_is_pipe(STDOUT_FILENO))
        cli_start_again(argv, "OMP_WAIT_POLICY", "passive");
}

#define THREADS_TURNS "1000"    /* before one that waits goes to sleep */

void cli_wait_briefly(char **argv)
{
    if (processors_allowed() > 1)
        cli_start_again(argv, "GOMP_SPINCOUNT", THREADS_TURNS);
}

void cli_expect_networks(void)
{
    if (!getenv("OMP_WAIT_POLICY"))
        setenv("GOMP_SPINCOUNT", THREADS_TURNS, 0);
}

/* All programs of a pipe work at the same time, on different frames; most of
 * the work is spid-splat's and spid-refine's.  A program that passes records
 * on, or whose input is as much work as its own, leaves half of the processors
 * to the other one.  With all processors each, the threads of one would wait
 * for those of the other at every barrier. */
static void cli_share_threads(bool hard_input)
{
    const bool passes_on = strcmp(cli.output, "-") == 0 &&
                           cli_is_pipe(STDOUT_FILENO);

    if (threads_given ||
        !(passes_on || (hard_input && cli_is_pipe(STDIN_FILENO))))
        return;
    cli.threads = (cli.threads + 1) / 2;
    parallel_set_width(cli.threads);
}

int cli_parse_stage(const struct cli_usage *usage, int argc, char **argv,
                    bool hard_input)
{
    int first;

    cli_wait_asleep(argv);
    first = cli_parse(usage, argc, argv);
    cli_share_threads(hard_input);
    return first;
}
