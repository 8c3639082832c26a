/* What every program shares: options, messages, exit codes, progress. */
#ifndef SPID_CMD_CLI_H
#define SPID_CMD_CLI_H

#include <stdbool.h>
#include <stddef.h>
#include <sysexits.h>

#include "lib/base/error.h"

/* The options every program has; cli_parse fills this. */
struct cli {
    const char *program;    /* "spid-flame" */
    const char *output;     /* -o, "-" by default */
    const char *model;      /* -m, or NULL: the search order of spid(1) */
    const char *stats;      /* --stats FILE, or NULL */
    int threads;            /* -j, at most the processors allowed */
    bool quiet;             /* -q */
};
extern struct cli cli;

enum cli_kind {
    CLI_FLAG,               /* bool *dest = true */
    CLI_INT,                /* long *dest, between min and max */
    CLI_FLOAT,              /* double *dest, between min and max */
    CLI_STRING,             /* const char **dest */
    CLI_CALL,               /* parse(value, dest) returns 0, or -1 and *err */
};

/* One row of a program's option table; the table ends with name == NULL. */
struct cli_option {
    const char *name;       /* long name, without the dashes */
    char letter;            /* short name, or 0 */
    enum cli_kind kind;
    void *dest;
    double min, max;        /* CLI_INT, CLI_FLOAT */
    const char *arg;        /* "N", "FILE"; NULL for a flag */
    const char *help;       /* one line */
    int (*parse)(const char *value, void *dest, struct error *err);
    bool written;           /* the value names a file that is written */
};

/* The rows of such a table: long name, letter or 0, where the value goes, and
 * what the kind needs. */
#define OPTION_FLAG(name, letter, dest, help)                                 \
    { name, letter, CLI_FLAG, dest, 0, 0, NULL, help, NULL, false }
#define OPTION_INT(name, letter, dest, min, max, arg, help)                   \
    { name, letter, CLI_INT, dest, min, max, arg, help, NULL, false }
#define OPTION_FLOAT(name, letter, dest, min, max, arg, help)                 \
    { name, letter, CLI_FLOAT, dest, min, max, arg, help, NULL, false }
#define OPTION_STRING(name, letter, dest, arg, help)                          \
    { name, letter, CLI_STRING, dest, 0, 0, arg, help, NULL, false }
#define OPTION_OUTPUT(name, letter, dest, arg, help)                          \
    { name, letter, CLI_STRING, dest, 0, 0, arg, help, NULL, true }
#define OPTION_CALL(name, letter, dest, arg, parse, help)                     \
    { name, letter, CLI_CALL, dest, 0, 0, arg, help, parse, false }

/* What --help says and cli_parse understands. */
struct cli_usage {
    const char *program;
    const char *synopsis;   /* as in the manual page, after the name */
    const char *purpose;    /* one line */
    const struct cli_option *options;
};

/* Parse; the shared options (--help --version -o -j -m -q --stats) are added.
 * --help and --version exit 0, misuse exits EX_USAGE naming option, value and
 * what would do.  Returns the index of the first operand in argv. */
int cli_parse(const struct cli_usage *usage, int argc, char **argv);
/* The same for a program that stands beside others in a pipe, frame by frame:
 * unless told otherwise it leaves half of the processors to the next program, or
 * hard_input to the one before, for which its input is as much work (spid(1),
 * -j). */
int cli_parse_stage(const struct cli_usage *usage, int argc, char **argv,
                    bool hard_input);

/* The one stream that the operands from argv[first] on may name, or "-"; more
 * than one is misuse. */
const char *cli_stream_operand(int first, int argc, char **argv);

/* stream_create of -o, but not under the name of a picture or a clip; dies when
 * it cannot be. */
struct stream_writer *cli_create_stream(const char *path);
/* die_error, with no END in the stream: the next program knows. */
void cli_abandon_stream(struct stream_writer *out, const struct error *err)
    __attribute__((noreturn));

/* Where the networks of Phase A are run: freed memory is kept for them. */
void cli_run_networks(void);

/* "program: text", then exit with code.  Never returns. */
void die(int code, const char *format, ...)
    __attribute__((format(printf, 2, 3), noreturn));
/* die with the error's own code (EX_SOFTWARE when it has none). */
void die_error(const struct error *err) __attribute__((noreturn));
/* "program: warning: text" on standard error unless -q. */
void warn(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* "program: text", likewise: what was done, in numbers. */
void notice(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* A bar on stderr when that is a terminal and the work is long; total 0 when
 * unknown.  note (may be NULL) is shown at the end of the line. */
void progress(const char *what, size_t done, size_t total, const char *note);
/* Clear the bar, if there was one: before anything else is said. */
void progress_end(void);

/* Per-stage times for --stats, as TSV: stage, calls, total, mean, median, p95
 * (ms).  stats_begin returns the clock; stats_end adds to the named stage. */
double stats_begin(void);
/* Add the time since stats_begin returned `begun` to the named stage. */
void stats_end(const char *stage, double begun);
/* Write the table of --stats, at the end of a program; ends it when that fails.
 * Nothing without --stats. */
void stats_write(void);

/* The model search order: -m, $SPID_MODEL, $XDG_DATA_HOME/spid, datadir/spid
 * (and examples/model beside an uninstalled binary).  Fills path with the
 * file `name` found there; -1 and *err listing what was tried. */
int cli_find_model(const char *name, char *path, size_t size,
                   struct error *err);

#endif
