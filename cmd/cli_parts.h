/* Between the files of the command line; programs use cmd/cli.h. */
#ifndef SPID_CMD_CLI_PARTS_H
#define SPID_CMD_CLI_PARTS_H

#include "cmd/cli.h"

/* Print the usage line, purpose and the n options, and exit 0. */
void cli_print_help(const struct cli_usage *u, const struct cli_option *all,
                    int n) __attribute__((noreturn));

/* Set cli.threads and OpenMP: wanted (-j), or when that is 0 OMP_NUM_THREADS,
 * or else one for every processor. */
void cli_use_threads(long wanted);

/* Threads do not spin from here on; starts the program again for it, unless
 * the environment says how they wait. */
void cli_wait_briefly(char **argv);

#endif
