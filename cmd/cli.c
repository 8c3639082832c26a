/* The command line of every program: one table of options over getopt_long. */
#include "cmd/cli.h"

#include <errno.h>
#include <getopt.h>
#include <malloc.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "cmd/cli_parts.h"
#include "formats/mark.h"
#include "lib/base/cpu.h"
#include "lib/base/file.h"
#include "lib/stream/stream.h"

struct cli cli = { .program = "spid", .output = "-" };

/* "64M" and the like, for --max-bytes. */
static int cli_option_bytes(const char *value, void *dest, struct error *err)
{
    static const char units[] = "KMGT";
    char *end;
    double v = strtod(value, &end);
    const char *unit = *end ? strchr(units, *end) : NULL;

    if (unit)
        for (end++; unit >= units; unit--)
            v *= 1024;
    if (end == value || *end || !(v >= 64 && v <= 0x1p46))
        return error_set(err, EX_USAGE, "not a size (expected bytes, or a "
                         "number with K, M or G)");
    *(size_t *)dest = (size_t)v;
    return 0;
}

/* --no-mark. */
static int cli_option_no_mark(const char *value, void *dest, struct error *err)
{
    (void)value;
    (void)dest;
    (void)err;
    mark_off();
    return 0;
}

static long threads;           /* -j; 0: not given */
static size_t max_bytes;       /* --max-bytes; 0: not given */
static const struct cli_option shared[] = {
    OPTION_OUTPUT("output", 'o', &cli.output, "FILE",
                  "write to FILE (\"-\": standard output, the default)"),
    OPTION_INT("threads", 'j', &threads, 1, 1024, "THREADS",
               "use this many threads (default: all processors)"),
    OPTION_STRING("model", 'm', &cli.model, "MODEL",
                  "model file, or the directory that holds it"),
    OPTION_FLAG("quiet", 'q', &cli.quiet, "no warnings, no progress"),
    OPTION_OUTPUT("stats", 0, &cli.stats, "FILE",
                  "write per-stage times to FILE as TSV"),
    OPTION_CALL("max-bytes", 0, &max_bytes, "SIZE", cli_option_bytes,
                "refuse larger records (default 1G)"),
    OPTION_CALL("no-mark", 0, NULL, NULL, cli_option_no_mark,
                "do not write into pictures and videos that they are "
                "synthetic"),
    OPTION_FLAG("help", 0, NULL, "this text"),
    OPTION_FLAG("version", 0, NULL, "the version"),
    { 0 }
};
#define SHARED ((int)(sizeof shared / sizeof *shared) - 1)
#define MAX_OPTIONS 64

/* A shared option that the program defines itself gives way to it. */
static bool cli_option_overridden(const struct cli_option *own, int n,
                                  const struct cli_option *o)
{
    for (int i = 0; i < n; i++)
        if (strcmp(own[i].name, o->name) == 0)
            return true;
    return false;
}

/* "--channels=abc", as the messages name an option and its value. */
#define BAD "--%s=%s: %s (expected %s)"

/* A CLI_INT or CLI_FLOAT from its text, or the end of the program. */
static void cli_option_number(const struct cli_option *o, const char *value)
{
    char *end, expected[80];
    double v;

    snprintf(expected, sizeof expected, "%s%g to %g",
             o->kind == CLI_INT ? "a whole number, " : "", o->min, o->max);
    errno = 0;
    v = o->kind == CLI_INT ? (double)strtol(value, &end, 10)
                           : strtod(value, &end);
    if (end == value || *end)
        die(EX_USAGE, BAD, o->name, value, "not a number", expected);
    if (errno || !(v >= o->min && v <= o->max))
        die(EX_USAGE, BAD, o->name, value, "out of range", expected);
    if (o->kind == CLI_INT)
        *(long *)o->dest = strtol(value, NULL, 10);
    else
        *(double *)o->dest = v;
}

/* Put value where o says. */
static void cli_option_set(const struct cli_option *o, const char *value)
{
    struct error err = { 0 };

    switch (o->kind) {
    case CLI_FLAG:
        *(bool *)o->dest = true;
        break;
    case CLI_INT:
    case CLI_FLOAT:
        cli_option_number(o, value);
        break;
    case CLI_STRING:
        *(const char **)o->dest = value;
        break;
    case CLI_CALL:
        if (o->parse(value, o->dest, &err))
            die(err.code, "--%s=%s: %s", o->name, value, err.text);
        break;
    }
}

/* getopt's two descriptions of the table, made from it. */
static void cli_option_getopt(struct option *lng, char *letters,
                              const struct cli_option *all, int n)
{
    *letters++ = ':';
    for (int i = 0; i < n; i++) {
        lng[i].name = all[i].name;
        lng[i].has_arg = all[i].arg ? required_argument : no_argument;
        lng[i].flag = NULL;
        lng[i].val = 256 + i;
        if (!all[i].letter)
            continue;
        *letters++ = all[i].letter;
        if (all[i].arg)
            *letters++ = ':';
    }
    lng[n] = (struct option){ 0 };
    *letters = '\0';
}

/* The option of the n that getopt_long returned value for, or NULL. */
static const struct cli_option *cli_option_by_value(
    const struct cli_option *all, int n, int value)
{
    if (value >= 256)
        return &all[value - 256];
    for (int i = 0; i < n; i++)
        if (all[i].letter == value)
            return &all[i];
    return NULL;
}

/* End with what getopt_long did not like. */
static void cli_option_misuse(int c, char **argv)
{
    const char *what = c == ':' ? "needs a value" : "is not an option";

    if (optopt && optopt < 256)
        die(EX_USAGE, "-%c %s (see --help)", optopt, what);
    die(EX_USAGE, "%s %s (see --help)", argv[optind - 1], what);
}

/* Reserve addresses for networks and pictures, in huge pages where the system
 * has some: getting a small page costs more than using it, and a first frame
 * took 60,000 of them.  Addresses that are not touched cost nothing. */
static void cli_reserve_heap(void)
{
    const uintptr_t page = (uintptr_t)2 << 20;
    const uintptr_t begin = (uintptr_t)sbrk(0);

    mallopt(M_TOP_PAD, 384 << 20);
    void *volatile more = malloc(16 << 20);     /* than there is yet */
    free(more);
    const uintptr_t end = (uintptr_t)sbrk(0) / page * page;
    const uintptr_t first = (begin + page - 1) / page * page;
#ifdef MADV_HUGEPAGE
    if (first < end)
        madvise((void *)first, end - first, MADV_HUGEPAGE);
#endif
    mallopt(M_TOP_PAD, 8 << 20);
}

void cli_run_networks(void)
{
    /* Freed memory stays: what comes from the system is zeroed page by page
     * before it is used, a tenth of the time to a first frame. */
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    /* and what one thread has freed serves the others */
    mallopt(M_ARENA_MAX, 1);
    cli_reserve_heap();
}

const char *cli_stream_operand(int first, int argc, char **argv)
{
    if (argc - first > 1)
        die(EX_USAGE, "%s: one stream at a time (expected at most one "
            "operand)", argv[first + 1]);
    return first < argc ? argv[first] : "-";
}

struct stream_writer *cli_create_stream(const char *path)
{
    struct error err = { 0 };
    struct stream_writer *out;

    if (file_is_media_name(path))
        die(EX_USAGE, "%s: records would be written under the name of a "
            "picture or a clip (expected a name such as x.spid)", path);
    out = stream_create(path, &err);
    if (!out)
        die_error(&err);
    return out;
}

void cli_abandon_stream(struct stream_writer *out, const struct error *err)
{
    stream_abandon(out);
    die_error(err);
}

/* What the shared options ask for. */
static void cli_option_apply_shared(void)
{
    struct error err = { 0 };

    signal(SIGPIPE, SIG_DFL); /* the next program has seen enough: end */
    if (cpu_check(&err))
        die_error(&err);
    cli_use_threads(threads);
    if (max_bytes)
        stream_set_limit(max_bytes);
    cpu_flush_denormals();
}

int cli_parse(const struct cli_usage *usage, int argc, char **argv)
{
    struct cli_option all[MAX_OPTIONS];
    struct option lng[MAX_OPTIONS + 1];
    char letters[2 * MAX_OPTIONS + 2];
    int n = 0, own, c;

    cli.program = usage->program;
    for (const struct cli_option *o = usage->options; o && o->name; o++)
        if (n < MAX_OPTIONS - SHARED)
            all[n++] = *o;
    own = n;
    for (int i = 0; i < SHARED; i++)
        if (!cli_option_overridden(all, own, &shared[i]))
            all[n++] = shared[i];
    cli_option_getopt(lng, letters, all, n);

    opterr = 0;
    while ((c = getopt_long(argc, argv, letters, lng, NULL)) != -1) {
        const struct cli_option *o = cli_option_by_value(all, n, c);

        if (c == '?' || c == ':' || !o)
            cli_option_misuse(c, argv);
        if (strcmp(o->name, "help") == 0)
            cli_print_help(usage, all, n);
        if (strcmp(o->name, "version") == 0) {
            printf("%s (SpiD toolkit) %s\n", usage->program, SPID_VERSION);
            exit(fflush(stdout) ? EX_IOERR : 0);
        }
        cli_option_set(o, optarg);
        if (optarg)
            cli_name_file(o->name, optarg, o->written);
    }
    for (int i = optind; i < argc; i++)
        cli_name_file(NULL, argv[i], false);
    cli_check_files();
    cli_option_apply_shared();
    return optind;
}
