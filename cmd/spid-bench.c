/* spid-bench: speed against error, stage by stage. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli.h"
#include "lib/base/cpu.h"
#include "lib/bench/bench.h"

static double seconds = 20;
static bool json;
static const char *scene;

static const struct cli_option options[] = {
    { "json", 0, CLI_FLAG, &json, 0, 0, NULL,
      "machine-readable: one JSON object", NULL },
    { "seconds", 's', CLI_FLOAT, &seconds, 0.1, 3600, "S",
      "about how long a stage may take (20)", NULL },
    { "scene", 0, CLI_STRING, &scene, 0, 0, "FILE",
      "splat: Gaussians of a .safetensors file", NULL },
    { 0 }
};

static const struct cli_usage usage = {
    "spid-bench", "[--json] [-s S] [--scene FILE] [-m MODEL] [-j THREADS] "
    "[-o FILE] STAGE...",
    "speed against error of every knob", options
};

static const struct stage {
    const char *name;
    int (*run)(struct bench *b, struct error *err);
} stages[] = {
    { "splat", bench_splat },
    { "stream", bench_stream },
    { "motion", bench_motion },
    { "shape", bench_shape },
    { "flame", bench_flame },
    { "branches", bench_branches },
    { "pipeline", bench_pipeline },
};

static const struct stage *find_stage(const char *name)
{
    char known[256] = "";

    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        if (!strcmp(name, stages[i].name))
            return &stages[i];
        strcat(known, i ? " " : "");
        strcat(known, stages[i].name);
    }
    die(EX_USAGE, "%s: no such stage (expected all, or one of: %s)", name,
        known);
}

/* Run a stage, or all of them; of all, one that finds no model or input is
 * only noted. */
static void run_stage(struct bench *b, const char *name)
{
    bool all = !strcmp(name, "all");
    struct error err = {0};

    if (!all) {
        if (find_stage(name)->run(b, &err))
            die_error(&err);
        return;
    }
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++)
        if (stages[i].run(b, &err)) {
            if (err.code != EX_NOINPUT)
                die_error(&err);
            bench_note(b, "%s: left out: %s", stages[i].name, err.text);
        }
}

static void write_report(const struct bench *b)
{
    char *text = json ? bench_json(b) : bench_table(b);
    FILE *f = strcmp(cli.output, "-") ? fopen(cli.output, "w") : stdout;

    if (!text)
        die(EX_OSERR, "out of memory");
    if (!f)
        die(EX_CANTCREAT, "%s: cannot be written", cli.output);
    if (fputs(text, f) < 0 || (json && putc('\n', f) < 0) || fflush(f) ||
        (f != stdout && fclose(f)))
        die(EX_IOERR, "%s: cannot be written", cli.output);
    free(text);
}

int main(int argc, char **argv)
{
    struct bench b;
    int at = cli_parse(&usage, argc, argv);

    if (at == argc)
        die(EX_USAGE, "no stage given (see spid-bench --help)");
    for (int i = at; i < argc; i++)
        if (strcmp(argv[i], "all"))
            find_stage(argv[i]);
    bench_init(&b);
    b.seconds = seconds;
    b.threads = cli.threads;
    b.model = cli.model;
    b.scene = scene;
    for (int i = at; i < argc; i++)
        run_stage(&b, argv[i]);
    write_report(&b);
    bench_release(&b);
    stats_write();
    return 0;
}
