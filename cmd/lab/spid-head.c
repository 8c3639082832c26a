/* spid-head: give the built-in head the shapes of ICT-FaceKit's scans, write it
 * as plain arrays, and compare it with those scans. */
#include <stdio.h>
#include <string.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "lib/lab/head/avatar_make.h"
#include "lib/lab/head/compare.h"
#include "lib/lab/head/register.h"
#include "lib/lab/head/subdivide.h"
#include "lib/lab/head/template.h"
#include "lib/lab/head/transfer.h"

static const char *from, *check, *head_path;
static bool subdivide;
static long people = 100;

static const struct cli_option options[] = {
    OPTION_STRING("from", 0, &from, "SCANS",
                  "give it the shapes of ICT-FaceKit's ict.safetensors"),
    OPTION_STRING("check", 0, &check, "SCANS",
                  "print how far a head is from random faces of the scans"),
    OPTION_FLAG("subdivide", 0, &subdivide,
                "write it with a vertex in the middle of every edge"),
    OPTION_INT("people", 0, &people, 1, 10000, "N",
               "how many faces --check draws"),
    OPTION_HEAD(&head_path),
    { 0 }
};

static const struct cli_usage usage = {
    "spid-head", "-o FILE [OPTION ...]",
    "write the built-in head model, compare it with scans", options
};

/* --from: the scans' shapes on the template's mesh. */
static void head_register(struct template *t)
{
    struct error err = {0};
    struct scan scan;
    struct registration r;
    double begun = stats_begin();

    if (scan_load(&scan, from, &err) ||
        registration_init(&r, t, &scan, &err))
        die_error(&err);
    stats_end("register", begun);
    begun = stats_begin();
    if (transfer_head(t, &r, &err))
        die_error(&err);
    stats_end("transfer", begun);
    registration_release(&r);
    scan_release(&scan);
}

/* The head to write, read, with the shapes of the scans if there are any. */
static void head_write_model(const char *path)
{
    struct error err = {0};
    struct template t;

    if (template_load(&t, path, &err))
        die_error(&err);
    if (from)
        head_register(&t);
    if (template_save(&t, cli.output, !from, &err) ||
        avatar_make_file(cli.output, path, &err))
        die_error(&err);
    template_release(&t);
}

/* --check: a table of distances, for faces at rest and two shares of their
 * expressions on. */
static void head_compare_models(const struct head *h)
{
    static const double active[] = { 0, 0.1, 0.25 };
    struct compare_part part[COMPARE_PARTS];
    struct error err = {0};
    struct scan scan;

    if (scan_load(&scan, check, &err))
        die_error(&err);
    printf("faces\tactive\tpart\tvertices\tmean_mm\tp95_mm\tlargest_mm\n");
    for (size_t i = 0; i < sizeof active / sizeof *active; i++) {
        if (compare_faces(part, h, &scan, (int)people, active[i], 1, &err))
            die_error(&err);
        for (int k = 0; k < COMPARE_PARTS; k++)
            printf("%ld\t%g\t%s\t%zu\t%.3f\t%.3f\t%.2f\n", people, active[i],
                   part[k].name, part[k].n, part[k].mean, part[k].p95,
                   part[k].worst);
    }
    scan_release(&scan);
}

int main(int argc, char **argv)
{
    char found[4096];
    struct error err = {0};
    struct head h = {0};

    if (cli_parse(&usage, argc, argv) < argc)
        die(EX_USAGE, "operands are not taken");
    int writes = strcmp(cli.output, "-") != 0;
    if (!writes && (from || !check))
        die(EX_USAGE, "no output file (expected -o FILE)");
    if (subdivide && from)
        die(EX_USAGE, "--subdivide and --from together (expected one after "
            "the other)");
    if (!head_path) {
        if (cli_find_model("head.safetensors", found, sizeof found, &err))
            die_error(&err);
        head_path = found;
    }
    if (writes) {
        if (!subdivide)
            head_write_model(head_path);
        else if (subdivide_head(cli.output, head_path, &err))
            die_error(&err);
        head_path = cli.output;
    }
    if (check) {
        if (head_load(&h, head_path, &err))
            die_error(&err);
        head_compare_models(&h);
        head_release(&h);
    }
    stats_write();
    return EX_OK;
}
