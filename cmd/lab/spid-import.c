/* spid-import: other programs' checkpoints as safetensors, without Python. */
#include <stdio.h>
#include <string.h>

#include "cmd/cli.h"
#include "lib/lab/convert/convert.h"
#include "lib/lab/head/avatar_make.h"

#define LINES 20            /* of one sort of problem that are printed */

static const char *kind;
static struct convert_options with;
static bool list;

static int import_parse_kind(const char *value, void *dest, struct error *err)
{
    for (size_t i = 0; convert_kinds[i]; i++)
        if (!strcmp(value, convert_kinds[i])) {
            *(const char **)dest = convert_kinds[i];
            return 0;
        }
    return error_set(err, EX_USAGE, "not a kind (expected flame, dinov2, "
                     "smirk, gagavatar, lam, lpips, arcface, musiq, "
                     "topiq, squeezenet, fan or model)");
}

static const struct cli_option options[] = {
    OPTION_CALL("as", 0, &kind, "KIND", import_parse_kind,
                "flame, dinov2, smirk, gagavatar, lam, lpips, arcface, "
                "musiq, topiq, squeezenet, fan or model"),
    OPTION_STRING("eyelids", 0, &with.eyelids, "FILE",
                  "flame: closing displacements, one file or LEFT,RIGHT"),
    OPTION_STRING("landmarks", 0, &with.landmarks, "FILE",
                  "flame: landmark embedding"),
    OPTION_STRING("linear", 0, &with.linear, "FILE", "lpips: linear weights"),
    OPTION_STRING("config", 0, &with.config, "FILE",
                  "gagavatar, lam: its configuration"),
    OPTION_STRING("encoders", 0, &with.encoders, "MODEL",
                  "gagavatar, lam: take motion and shape encoder of this "
                  "model"),
    OPTION_STRING("head", 0, &with.head, "FILE",
                  "gagavatar, lam, model: move encoders to this head"),
    OPTION_STRING("from-head", 0, &with.from_head, "FILE",
                  "the head they were trained with"),
    OPTION_FLAG("list", 0, &list,
                "print name, type and shape of every tensor"),
    { 0 }
};

static const struct cli_usage usage = {
    "spid-import", "FILE -o OUT [OPTION ...] | FILE --list",
    "convert public checkpoints to safetensors", options
};

/* One line per tensor: name, type, shape; then what is none. */
static void import_print_list(const struct tensorfile *f)
{
    static const char *const label[] = {"", ", left out"};
    const char *what;

    for (size_t i = 0; i < tensorfile_count(f); i++) {
        const struct tensorfile_tensor *t = tensorfile_at(f, i);

        printf("%s\t%s\t[", t->name, st_dtype_name(t->dtype));
        for (int k = 0; k < t->ndim; k++)
            printf("%s%zu", k ? ", " : "", t->dim[k]);
        printf("]\n");
    }
    for (int sort = 0; sort < TENSORFILE_SORTS; sort++) {
        size_t n = tensorfile_others(f, sort);

        for (size_t i = 0; i < n && i < TENSORFILE_NOTED; i++) {
            const char *name = tensorfile_other(f, sort, i, &what);

            printf("# %s: %s%s\n", name, what, label[sort]);
        }
        if (n > TENSORFILE_NOTED)
            printf("# and %zu more that are no tensors\n",
                   n - TENSORFILE_NOTED);
    }
}

/* A line for each object that was passed over. */
static void import_print_objects(const struct tensorfile *f)
{
    size_t n = tensorfile_others(f, TENSORFILE_OBJECT);
    const char *what;

    for (size_t i = 0; i < n && i < LINES; i++) {
        const char *name = tensorfile_other(f, TENSORFILE_OBJECT, i, &what);

        warn("%s: left out: %s (%s: no array)", tensorfile_path(f), name,
             what);
    }
    if (n > LINES)
        warn("%s: left out: %zu more objects", tensorfile_path(f), n - LINES);
}

/* What of one sort the conversion noted. */
static void import_print_problems(const struct convert *c, const char *path,
                                  enum convert_problem what, const char *label)
{
    size_t n = 0;

    for (size_t i = 0; i < c->problems; i++)
        if (c->problem[i].what == what && n++ < LINES)
            warn("%s: %s%s", path, label, c->problem[i].text);
    if (n > LINES)
        warn("%s: %sand %zu more", path, label, n - LINES);
}

/* Convert, tell what does not fit, and end the program unless all of the
 * kind was there. */
static void import_convert_file(struct convert *c, struct tensorfile *f,
                                struct error *err)
{
    const char *path = tensorfile_path(f);

    if (kind ? convert_as(c, f, kind, &with, err) : convert_all(c, f, err))
        die_error(err);
    import_print_problems(c, path, CONVERT_MISSING, "missing: ");
    import_print_problems(c, path, CONVERT_SHAPE, "wrong shape: ");
    import_print_problems(c, path, CONVERT_LEFT, "left over: ");
    import_print_problems(c, path, CONVERT_REMARK, "");
    if (c->wrong)
        die(EX_DATAERR, "%s: not a whole %s: %zu tensors are missing or have "
            "a wrong shape", path, kind, c->wrong);
    if (!c->count)
        die(EX_DATAERR, "%s: holds no tensors", path);
}

/* A head gets a template avatar, with the built-in head's mouth. */
static int import_add_avatar(struct error *err)
{
    char path[4096];

    return cli_find_model("head.safetensors", path, sizeof path, err) ||
           avatar_make_file(cli.output, path, err) ? -1 : 0;
}

int main(int argc, char **argv)
{
    struct error err = {0};
    struct convert c;
    int first = cli_parse(&usage, argc, argv);

    if (argc - first != 1)
        die(EX_USAGE, "%d files are given (expected one)", argc - first);
    if (!list && !strcmp(cli.output, "-"))
        die(EX_USAGE, "no output file (expected -o FILE, or --list)");
    double begun = stats_begin();
    struct tensorfile *f = tensorfile_open(argv[first], &err);
    if (!f)
        die_error(&err);
    stats_end("open", begun);
    if (list) {
        import_print_list(f);
        if (fflush(stdout) || ferror(stdout))
            die(EX_IOERR, "<stdout>: cannot write");
    } else {
        begun = stats_begin();
        import_print_objects(f);
        import_convert_file(&c, f, &err);
        if (convert_save(&c, cli.output, &err) ||
            (kind && !strcmp(kind, "flame") && import_add_avatar(&err)))
            die_error(&err);
        stats_end("convert", begun);
        convert_release(&c);
    }
    tensorfile_close(f);
    stats_write();
    return EX_OK;
}
