/* How many threads a program uses, alone and beside the other programs of a
 * pipe. */
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cmd/cli_parts.h"
#include "lib/base/parallel.h"
#include "lib/base/processors.h"

static bool threads_given;     /* by -j */

/* More threads than processors that may be used would take turns on them. */
void cli_use_threads(long wanted)
{
    const int allowed = processors_allowed();

    threads_given = wanted > 0;
    cli.threads = wanted > 0 && wanted < allowed ? (int)wanted : allowed;
    parallel_set_width(cli.threads);
}

/* Is fd one end of a pipe? */
static bool cli_is_pipe(int fd)
{
    struct stat st;

    return fstat(fd, &st) == 0 && S_ISFIFO(st.st_mode);
}

/* All programs of a pipe work at the same time, on different frames; most of
 * the work is spid-splat's and spid-refine's.  A program that passes records
 * on, or whose input is as much work as its own, leaves half of the processors
 * to the other one. */
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
    const int first = cli_parse(usage, argc, argv);

    cli_share_threads(hard_input);
    return first;
}
