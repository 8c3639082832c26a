/* spid-bench: speed against error, stage by stage. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

#include "cmd/cli.h"
#include "formats/outfile.h"
#include "lib/base/file.h"
#include "lib/lab/bench/bench.h"

static double seconds = 20;
static bool json, tsv;
static const char *scene, *plot;

static const struct cli_option options[] = {
    OPTION_FLAG("json", 0, &json, "machine-readable: one JSON object"),
    OPTION_FLAG("tsv", 0, &tsv,
                "a row per line, tabs between, # before what is no row"),
    OPTION_OUTPUT("plot", 0, &plot, "FILE",
                  "also draw speed against error (.png, .svg, .pdf, or .gp: "
                  "the script)"),
    OPTION_FLOAT("seconds", 's', &seconds, 0.1, 3600, "S",
                 "about how long a stage may take (20)"),
    OPTION_STRING("scene", 0, &scene, "FILE",
                  "splat: Gaussians of a .safetensors file"),
    { 0 }
};

static const struct cli_usage usage = {
    "spid-bench", "[OPTION ...] STAGE...",
    "speed against error of every knob", options
};

static const struct stage {
    const char *name;
    int (*run)(struct bench *b, struct error *err);
} stages[] = {
    { "splat", bench_splat },
    { "motion", bench_motion },
    { "shape", bench_shape },
    { "refine", bench_refine },
    { "flame", bench_flame },
    { "branches", bench_branches },
    { "train", bench_train },
    { "pipeline", bench_pipeline },
    { "shared", bench_shared },
};

/* By its name, or the program ends. */
static const struct stage *bench_find_stage(const char *name)
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
static void bench_run_stage(struct bench *b, const char *name)
{
    bool all = !strcmp(name, "all");
    struct error err = {0};

    if (!all) {
        if (bench_find_stage(name)->run(b, &err))
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

/* To a file or standard output. */
static void bench_write_text(const char *text, const char *path)
{
    struct outfile o;
    struct error err = {0};

    if (outfile_open_text(&o, path, &err))
        die_error(&err);
    fputs(text, o.file);
    if (outfile_close(&o, &err))
        die_error(&err);
}

/* In the form asked for. */
static void bench_write_report(const struct bench *b)
{
    char *text = json ? bench_json(b) : tsv ? bench_tsv(b) : bench_table(b);

    if (!text)
        die(EX_OSERR, "out of memory");
    bench_write_text(text, cli.output);
    free(text);
}

/* The picture, by gnuplot; under a .gp name only what would draw it. */
static void bench_write_plot(const struct bench *b)
{
    bool script = file_ends(plot, ".gp");
    char name[4096], part[4104];
    struct error err = {0};
    int rc = 0;

    snprintf(name, sizeof name, "%.*s%s",
             (int)(strlen(plot) - (script ? 3 : 0)), plot,
             script ? ".png" : "");
    /* gnuplot's kind of picture follows the name, so .part goes before it */
    const char *dot = strrchr(plot, '.');
    snprintf(part, sizeof part, "%.*s.part%s",
             (int)(dot ? dot - plot : (long)strlen(plot)), plot,
             dot ? dot : "");
    char *text = bench_plot(b, script ? name : part, &err);
    if (!text)
        die_error(&err);
    if (script) {
        bench_write_text(text, plot);
    } else {
        signal(SIGPIPE, SIG_IGN);   /* it may end before it has read all */
        FILE *f = popen("command -v gnuplot >/dev/null || exit 127; "
                        "exec gnuplot", "w");

        if (f)
            fputs(text, f);
        if (!f || (rc = pclose(f)) != 0) {
            remove(part);
            if (WIFEXITED(rc) && WEXITSTATUS(rc) == 127)
                die(EX_UNAVAILABLE, "%s: no gnuplot to draw it (Debian's "
                    "gnuplot-nox; a name in .gp keeps the script)", plot);
            die(EX_IOERR, "%s: gnuplot failed", plot);
        }
        if (rename(part, plot))
            die(EX_CANTCREAT, "%s: cannot be written", plot);
    }
    free(text);
}

/* The files the program itself would find; -m must exist. */
static void bench_find_model(struct bench *b)
{
    static char model[4096], head[4096];
    struct error err = {0};

    if (!cli_find_model("model.safetensors", model, sizeof model, &err))
        b->model = model;
    else if (cli.model)
        die_error(&err);
    if (!cli_find_model("head.safetensors", head, sizeof head, &err))
        b->head = head;
}

int main(int argc, char **argv)
{
    struct bench b;
    int at = cli_parse(&usage, argc, argv);

    if (at == argc)
        die(EX_USAGE, "no stage given (see spid-bench --help)");
    if (json && tsv)
        die(EX_USAGE, "--json and --tsv exclude each other");
    for (int i = at; i < argc; i++)
        if (strcmp(argv[i], "all"))
            bench_find_stage(argv[i]);
    bench_init(&b);
    b.seconds = seconds;
    b.threads = cli.threads;
    b.scene = scene;
    bench_find_model(&b);
    for (int i = at; i < argc; i++)
        bench_run_stage(&b, argv[i]);
    bench_write_report(&b);
    if (plot)
        bench_write_plot(&b);
    bench_release(&b);
    stats_write();
    return 0;
}
