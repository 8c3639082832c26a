/* Between the files of the command line; programs use cmd/cli.h. */
#ifndef SPID_CMD_CLI_PARTS_H
#define SPID_CMD_CLI_PARTS_H

#include "cmd/cli.h"

/* Print the usage line, purpose and the n options, and exit 0. */
void cli_print_help(const struct cli_usage *u, const struct cli_option *all,
                    int n) __attribute__((noreturn));

#define CLI_NAMES 1024          /* of files that are compared */

/* Remember a name that an option (NULL: an operand) gives. */
void cli_name_file(const char *option, const char *value, bool written);
/* Die where one that is written is the same file as another, by device and
 * inode. */
void cli_check_files(void);

/* Set cli.threads and the width of lib/base/parallel.h: wanted (-j) or, when
 * that is 0, one for every processor allowed, and never more. */
void cli_use_threads(long wanted);

#endif
