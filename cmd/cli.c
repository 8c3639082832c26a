#include "cmd/cli.h"

#include <errno.h>
#include <getopt.h>
#include <omp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lib/base/cpu.h"
#include "lib/stream/stream.h"

struct cli cli = { .program = "spid", .output = "-" };

static struct {
    double begun, drawn;
    int width;                 /* of the line on the screen; 0: none */
} bar;

static void erase_bar(void)
{
    if (bar.width)
        fprintf(stderr, "\r%-*s\r", bar.width, "");
    bar.width = 0;
}

/* ---- messages --------------------------------------------------------- */

static void say(const char *kind, const char *format, va_list ap)
{
    char text[1024];

    vsnprintf(text, sizeof text, format, ap);
    erase_bar();
    fprintf(stderr, "%s: %s%s\n", cli.program, kind, text);
}

void die(int code, const char *format, ...)
{
    va_list ap;

    va_start(ap, format);
    say("", format, ap);
    va_end(ap);
    exit(code);
}

void die_error(const struct error *err)
{
    die(err->code ? err->code : EX_SOFTWARE, "%s", err->text);
}

void warn(const char *format, ...)
{
    va_list ap;

    if (cli.quiet)
        return;
    va_start(ap, format);
    say("warning: ", format, ap);
    va_end(ap);
}

/* ---- options ---------------------------------------------------------- */

static double option_threads(void)
{
    long n = sysconf(_SC_NPROCESSORS_ONLN);

    return n < 1 ? 1 : (double)n;
}

/* "64M" and the like, for --max-bytes. */
static int parse_bytes(const char *value, void *dest, struct error *err)
{
    static const char units[] = "KMGT";
    char *end;
    double v = strtod(value, &end);
    const char *unit = *end ? strchr(units, *end) : NULL;

    if (unit)
        for (end++; unit >= units; unit--)
            v *= 1024.0;
    if (end == value || *end || !(v >= 64.0 && v <= 0x1p46))
        return error_set(err, EX_USAGE, "not a size (expected bytes, or a "
                         "number with K, M or G)");
    *(size_t *)dest = (size_t)v;
    return 0;
}

static long threads;
static size_t max_bytes;
static const struct cli_option shared[] = {
    { "output", 'o', CLI_STRING, &cli.output, 0, 0, "FILE",
      "write to FILE (\"-\": standard output, the default)", NULL },
    { "threads", 'j', CLI_INT, &threads, 1, 1024, "THREADS",
      "use this many threads (default: all processors)", NULL },
    { "model", 'm', CLI_STRING, &cli.model, 0, 0, "MODEL",
      "model file, or the directory that holds it", NULL },
    { "quiet", 'q', CLI_FLAG, &cli.quiet, 0, 0, NULL,
      "no warnings, no progress", NULL },
    { "stats", 0, CLI_STRING, &cli.stats, 0, 0, "FILE",
      "write per-stage times to FILE as TSV", NULL },
    { "max-bytes", 0, CLI_CALL, &max_bytes, 0, 0, "SIZE",
      "refuse larger records (default 1G)", parse_bytes },
    { "help", 0, CLI_FLAG, NULL, 0, 0, NULL, "this text", NULL },
    { "version", 0, CLI_FLAG, NULL, 0, 0, NULL, "the version", NULL },
    { 0 }
};
#define SHARED ((int)(sizeof shared / sizeof *shared) - 1)
#define MAX_OPTIONS 64

static int compare_names(const struct cli_option *o, const char *name)
{
    return strcmp(o->name, name);
}

/* A shared option that the program defines itself gives way to it. */
static bool is_overridden(const struct cli_option *own, int n,
                          const struct cli_option *o)
{
    for (int i = 0; i < n; i++)
        if (compare_names(&own[i], o->name) == 0)
            return true;
    return false;
}

static void print_option(const struct cli_option *o)
{
    char left[80];

    snprintf(left, sizeof left, "%s%c%s--%s%s%s", o->letter ? "-" : " ",
             o->letter ? o->letter : ' ', o->letter ? ", " : "  ", o->name,
             o->arg ? "=" : "", o->arg ? o->arg : "");
    if (strlen(left) > 24)
        printf("  %s\n  %-24s  %s\n", left, "", o->help);
    else
        printf("  %-24s  %s\n", left, o->help);
}

/* "Usage: program words", broken before a word outside all brackets so that
 * no line is longer than 79. */
static void print_usage(const struct cli_usage *u)
{
    int indent = 8 + (int)strlen(u->program), at = indent - 1;
    const char *p = u->synopsis;

    printf("Usage: %s", u->program);
    while (*p) {
        int n = 0, depth = 0;

        for (; p[n] && (depth || p[n] != ' '); n++)
            depth += p[n] == '[' ? 1 : p[n] == ']' ? -1 : 0;
        if (at + 1 + n > 79 && at >= indent) {
            printf("\n%*s", indent - 1, "");
            at = indent - 1;
        }
        printf(" %.*s", n, p);
        at += 1 + n;
        p += n;
        p += strspn(p, " \n");
    }
}

static void print_help(const struct cli_usage *u, const struct cli_option *all,
                       int n)
{
    print_usage(u);
    printf("\n\n%s\n\n", u->purpose);
    for (int i = 0; i < n; i++)
        print_option(&all[i]);
    printf("\nSee %s(1) for the rest.\n", u->program);
    if (fflush(stdout))
        die(EX_IOERR, "<stdout>: cannot write: %s", strerror(errno));
    exit(0);
}

/* "--channels=abc", as the messages name an option and its value. */
#define BAD "--%s=%s: %s (expected %s)"

static void set_number(const struct cli_option *o, const char *value)
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

static void set_option(const struct cli_option *o, const char *value)
{
    struct error err = { 0 };

    switch (o->kind) {
    case CLI_FLAG:
        *(bool *)o->dest = true;
        break;
    case CLI_INT:
    case CLI_FLOAT:
        set_number(o, value);
        break;
    case CLI_STRING:
        *(const char **)o->dest = value;
        break;
    case CLI_CALL:
        if (o->parse(value, o->dest, &err))
            die(EX_USAGE, "--%s=%s: %s", o->name, value, err.text);
        break;
    }
}

/* getopt's two descriptions of the table, made from it. */
static void make_getopt(struct option *lng, char *letters,
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

static const struct cli_option *by_value(const struct cli_option *all, int n,
                                         int value)
{
    if (value >= 256)
        return &all[value - 256];
    for (int i = 0; i < n; i++)
        if (all[i].letter == value)
            return &all[i];
    return NULL;
}

static void misuse(int c, char **argv)
{
    const char *what = c == ':' ? "needs a value" : "is not an option";

    if (optopt && optopt < 256)
        die(EX_USAGE, "-%c %s (see --help)", optopt, what);
    die(EX_USAGE, "%s %s (see --help)", argv[optind - 1], what);
}

static void apply_shared(void)
{
    signal(SIGPIPE, SIG_DFL); /* the next program has seen enough: end */
    if (threads)
        cli.threads = (int)threads;
    else if (getenv("OMP_NUM_THREADS"))
        cli.threads = omp_get_max_threads();
    else
        cli.threads = (int)option_threads();
    omp_set_num_threads(cli.threads);
    if (max_bytes)
        stream_set_limit(max_bytes);
    cpu_flush_denormals();
}

static bool is_pipe(int fd)
{
    struct stat st;

    return fstat(fd, &st) == 0 && S_ISFIFO(st.st_mode);
}

/* The programs of a pipe share the processors.  OpenMP's threads wait for each
 * other by spinning, milliseconds long, which keeps the other programs from
 * the very work that is waited for: the pipe runs at a third of its speed.
 * The library reads how to wait before main begins, hence another start.
 * Whoever sets the variable decides for himself. */
static void wait_asleep(char **argv)
{
    char path[4096];
    ssize_t n;

    if (getenv("OMP_WAIT_POLICY") ||
        !(is_pipe(STDIN_FILENO) || is_pipe(STDOUT_FILENO)))
        return;
    n = readlink("/proc/self/exe", path, sizeof path - 1);
    if (n <= 0 || setenv("OMP_WAIT_POLICY", "passive", 0))
        return;
    path[n] = 0;
    execv(path, argv);         /* if it fails: slower, not wrong */
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
        if (!is_overridden(all, own, &shared[i]))
            all[n++] = shared[i];
    make_getopt(lng, letters, all, n);

    opterr = 0;
    while ((c = getopt_long(argc, argv, letters, lng, NULL)) != -1) {
        const struct cli_option *o = by_value(all, n, c);

        if (c == '?' || c == ':' || !o)
            misuse(c, argv);
        if (strcmp(o->name, "help") == 0)
            print_help(usage, all, n);
        if (strcmp(o->name, "version") == 0) {
            printf("%s (SpiD toolkit) %s\n", usage->program, SPID_VERSION);
            exit(fflush(stdout) ? EX_IOERR : 0);
        }
        set_option(o, optarg);
    }
    apply_shared();
    return optind;
}

/* Two programs of a pipe have most of the work, spid-splat and spid-refine,
 * and all of them work on different frames at the same time.  A program that
 * passes records on, or takes in what another one works as hard for, leaves it
 * half of the processors: with all of them each, the threads of one would wait
 * for those of the other at every barrier. */
static void share_processors(bool hard_input)
{
    const bool passes_on = strcmp(cli.output, "-") == 0 &&
                           is_pipe(STDOUT_FILENO);

    if (threads || getenv("OMP_NUM_THREADS") ||
        !(passes_on || (hard_input && is_pipe(STDIN_FILENO))))
        return;
    cli.threads = (cli.threads + 1) / 2;
    omp_set_num_threads(cli.threads);
}

int cli_parse_stage(const struct cli_usage *usage, int argc, char **argv,
                    bool hard_input)
{
    int first;

    wait_asleep(argv);
    first = cli_parse(usage, argc, argv);
    share_processors(hard_input);
    return first;
}

/* ---- progress --------------------------------------------------------- */

#define LONG_WORK 1.0          /* seconds before a bar appears */
#define REDRAW 0.1             /* seconds between two drawings */

void progress(const char *what, size_t done, size_t total, const char *note)
{
    static int terminal = -1;
    double now = cpu_seconds(), spent, left;
    char line[200], mid[60] = "";
    int n;

    if (terminal < 0)
        terminal = isatty(STDERR_FILENO);
    if (!terminal || cli.quiet)
        return;
    if (bar.begun <= 0)
        bar.begun = now;
    spent = now - bar.begun;
    if (spent < LONG_WORK || (now - bar.drawn < REDRAW && done != total))
        return;
    bar.drawn = now;
    if (total && done) {
        int part = (int)(20.0 * (double)done / (double)total);

        left = spent / (double)done * (double)(total - done);
        snprintf(mid, sizeof mid, "/%zu [%-20.*s] %.0f s left", total,
                 part > 20 ? 20 : part, "####################", left);
    }
    n = snprintf(line, sizeof line, "%s %zu%s%s%s", what, done, mid,
                 note ? " " : "", note ? note : "");
    n = n > 79 ? 79 : n;
    fprintf(stderr, "\r%-*.79s", bar.width > n ? bar.width : n, line);
    bar.width = n;
}

void progress_end(void)
{
    erase_bar();
    bar.begun = 0;
}

/* ---- statistics ------------------------------------------------------- */

#define MAX_STAGES 32

static struct stage {
    const char *name;
    double *ms;                /* every call, for the median */
    size_t count, room;
} stages[MAX_STAGES];

double stats_begin(void)
{
    return cli.stats ? cpu_seconds() : 0.0;
}

void stats_end(const char *name, double begun)
{
    struct stage *s = stages;

    if (!cli.stats)
        return;
    while (s < stages + MAX_STAGES && s->name && strcmp(s->name, name))
        s++;
    if (s == stages + MAX_STAGES)
        return;
    s->name = name;
    if (s->count == s->room) {
        size_t room = s->room ? 2 * s->room : 1024;
        double *ms = realloc(s->ms, room * sizeof *ms);

        if (!ms)
            return;
        s->ms = ms;
        s->room = room;
    }
    s->ms[s->count++] = 1e3 * (cpu_seconds() - begun);
}

static int compare_ms(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

void stats_write(void)
{
    FILE *f;

    if (!cli.stats)
        return;
    f = strcmp(cli.stats, "-") ? fopen(cli.stats, "w") : stderr;
    if (!f)
        die(EX_CANTCREAT, "%s: cannot create: %s", cli.stats,
            strerror(errno));
    fprintf(f, "stage\tcalls\ttotal_ms\tmean_ms\tmedian_ms\tp95_ms\n");
    for (struct stage *s = stages; s < stages + MAX_STAGES && s->count; s++) {
        double total = 0;

        qsort(s->ms, s->count, sizeof *s->ms, compare_ms);
        for (size_t i = 0; i < s->count; i++)
            total += s->ms[i];
        fprintf(f, "%s\t%zu\t%.3f\t%.4f\t%.4f\t%.4f\n", s->name, s->count,
                total, total / (double)s->count, s->ms[s->count / 2],
                s->ms[(s->count * 95) / 100]);
        free(s->ms);
        *s = (struct stage){ 0 };
    }
    if (f != stderr && fclose(f))
        die(EX_IOERR, "%s: cannot write: %s", cli.stats, strerror(errno));
}

/* ---- model search ----------------------------------------------------- */

/* Does dir/name (or dir itself, when it is no directory) open?  Every try is
 * added to the list for the message. */
static bool try_path(char *path, size_t size, char *tried, size_t room,
                     const char *dir, const char *name)
{
    size_t used = strlen(tried);

    snprintf(path, size, "%s%s%s", dir, name ? "/" : "", name ? name : "");
    if (access(path, R_OK) == 0)
        return true;
    snprintf(tried + used, room - used, "%s%s", used ? ", " : "", path);
    return false;
}

/* -m or $SPID_MODEL names the model file itself, whose directory then holds
 * the others, or a directory. */
static bool try_given(char *path, size_t size, char *tried, size_t room,
                      const char *given, const char *name)
{
    char dir[512];
    char *slash;
    size_t n = strlen(given);

    if (try_path(path, size, tried, room, given, name))
        return true;
    if (n < 12 || strcmp(given + n - 12, ".safetensors") != 0)
        return false;
    if (strcmp(name, "model.safetensors") == 0)
        return try_path(path, size, tried, room, given, NULL);
    snprintf(dir, sizeof dir, "%s", given);
    slash = strrchr(dir, '/');
    if (slash)
        *slash = '\0';
    return try_path(path, size, tried, room, slash ? dir : ".", name);
}

/* Directory of the running binary plus suffix, for an uninstalled tree. */
static bool try_beside(char *path, size_t size, char *tried, size_t room,
                       const char *suffix, const char *name)
{
    char exe[400], dir[512];
    ssize_t n = readlink("/proc/self/exe", exe, sizeof exe - 1);
    char *slash;

    if (n <= 0)
        return false;
    exe[n] = '\0';
    slash = strrchr(exe, '/');
    if (slash)
        *slash = '\0';
    snprintf(dir, sizeof dir, "%s/%s", exe, suffix);
    return try_path(path, size, tried, room, dir, name);
}

int cli_find_model(const char *name, char *path, size_t size,
                   struct error *err)
{
    const char *env = getenv("SPID_MODEL");
    const char *data = getenv("XDG_DATA_HOME");
    const char *home = getenv("HOME");
    char tried[400] = "", dir[300];

    if (cli.model && try_given(path, size, tried, sizeof tried, cli.model,
                               name))
        return 0;
    /* A model asked for by name is not quietly replaced by another; only the
     * files that go with every model are still looked for. */
    if (cli.model && strcmp(name, "model.safetensors") == 0)
        goto fail;
    if (env && try_given(path, size, tried, sizeof tried, env, name))
        return 0;
    if (data && *data)
        snprintf(dir, sizeof dir, "%s/spid", data);
    else
        snprintf(dir, sizeof dir, "%s/.local/share/spid", home ? home : "");
    if (try_path(path, size, tried, sizeof tried, dir, name) ||
        try_path(path, size, tried, sizeof tried, SPID_DATADIR, name) ||
        try_beside(path, size, tried, sizeof tried, "../share/spid", name) ||
        try_beside(path, size, tried, sizeof tried, "../../examples/model",
                   name))
        return 0;
fail:
    return error_set(err, EX_NOINPUT, "%s not found (tried %s)", name, tried);
}
