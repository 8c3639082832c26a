/* spid-eval: how far results are from the truth, as the paper's tables. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cmd/cli.h"
#include "formats/image.h"
#include "lib/base/file.h"
#include "lib/eval/compare.h"
#include "lib/eval/people.h"

#define PATH 600
#define FIELDS 5 /* of a pairs file: name, kind, truth, result, protocol */

static struct {
    const char *format, *name, *pairs, *frames_tsv, *people, *sheet, *head;
    const char *lpips;
    unsigned truth;
    bool motion, no_ablations, no_cross;
    long count, frames, stride, rows;
} opt = {.format = "text", .name = "result", .count = 40, .frames = 25,
         .stride = 5, .rows = 8};

static int parse_known(const char *value, void *dest, struct error *err)
{
    unsigned *bits = dest;

    if (strcmp(value, "shape") == 0)
        *bits |= SUBJECT_TRUE_SHAPE;
    else if (strcmp(value, "motion") == 0)
        *bits |= SUBJECT_TRUE_MOTION;
    else
        return error_set(err, EX_USAGE, "unknown truth \"%s\" (expected "
                         "shape or motion)", value);
    return 0;
}

static const struct cli_option options[] = {
    {.name = "format", .letter = 'f', .kind = CLI_STRING, .dest = &opt.format,
     .arg = "KIND", .help = "text, tsv, json or latex (default text)"},
    {.name = "motion", .kind = CLI_FLAG, .dest = &opt.motion,
     .help = "TRUTH and RESULT are motion streams, not frames"},
    {.name = "name", .kind = CLI_STRING, .dest = &opt.name, .arg = "NAME",
     .help = "of the table's row (default result)"},
    {.name = "pairs", .kind = CLI_STRING, .dest = &opt.pairs, .arg = "FILE",
     .help = "compare every pair the file lists"},
    {.name = "frames-tsv", .kind = CLI_STRING, .dest = &opt.frames_tsv,
     .arg = "FILE", .help = "write the figures of every frame there"},
    {.name = "lpips", .kind = CLI_STRING, .dest = &opt.lpips, .arg = "FILE",
     .help = "AlexNet and LPIPS weights: adds the column lpips"},
    {.name = "people", .kind = CLI_STRING, .dest = &opt.people,
     .arg = "STREAM", .help = "judge the model (-m) on people of spid-synth"},
    {.name = "count", .kind = CLI_INT, .dest = &opt.count, .min = 1,
     .max = 100000, .arg = "N", .help = "--people: how many (default 40)"},
    {.name = "frames", .kind = CLI_INT, .dest = &opt.frames, .min = 2,
     .max = 100000, .arg = "N",
     .help = "--people: of each, the source included (default 25)"},
    {.name = "stride", .kind = CLI_INT, .dest = &opt.stride, .min = 1,
     .max = 1000, .arg = "N",
     .help = "--people: ablations and cross use every Nth (default 5)"},
    {.name = "no-ablations", .kind = CLI_FLAG, .dest = &opt.no_ablations,
     .help = "--people: leave the ablations out"},
    {.name = "no-cross", .kind = CLI_FLAG, .dest = &opt.no_cross,
     .help = "--people: leave cross-reenactment out"},
    {.name = "known", .kind = CLI_CALL, .dest = &opt.truth,
     .parse = parse_known, .arg = "WHAT",
     .help = "--people: the true shape or motion, not the encoder's"},
    {.name = "sheet", .kind = CLI_STRING, .dest = &opt.sheet, .arg = "FILE",
     .help = "--people: contact sheet (PNG)"},
    {.name = "rows", .kind = CLI_INT, .dest = &opt.rows, .min = 1,
     .max = 64, .arg = "N", .help = "--sheet: people on it (default 8)"},
    {.name = "head", .kind = CLI_STRING, .dest = &opt.head, .arg = "FILE",
     .help = "head model (default: head.safetensors beside the model)"},
    {.name = NULL},
};

static const struct cli_usage usage = {
    .program = "spid-eval",
    .synopsis = "[OPTION ...] [TRUTH RESULT]",
    .purpose = "the paper's metrics of frames, motions or a whole model",
    .options = options,
};

static int load_head(struct head *h, int must)
{
    struct error err = {0};
    char path[PATH];

    if (opt.head)
        snprintf(path, sizeof path, "%s", opt.head);
    else if (cli_find_model("head.safetensors", path, sizeof path, &err)) {
        if (must)
            die_error(&err);
        return 0;
    }
    if (head_load(h, path, &err))
        die_error(&err);
    return 1;
}

/* ---- output ------------------------------------------------------------- */

/* The figures issue and papers name, flat; then every row as an object. */
static void write_model_json(FILE *f, const struct table *t)
{
    static const struct {
        const char *key, *row, *column;
    } flat[] = {
        {"psnr", "SpiD", "psnr"},
        {"ssim", "SpiD", "ssim"},
        {"msssim", "SpiD", "msssim"},
        {"l1", "SpiD", "l1"},
        {"psnr_star", "SpiD*", "psnr"},
        {"ssim_star", "SpiD*", "ssim"},
        {"psnr_source", "source", "psnr"},
        {"ssim_source", "source", "ssim"},
        {"pose_deg", "SpiD", "pose_deg"},
        {"yaw_deg", "SpiD", "yaw_deg"},
        {"pitch_deg", "SpiD", "pitch_deg"},
        {"roll_deg", "SpiD", "roll_deg"},
        {"landmark_pct", "SpiD", "landmark_pct"},
        {"landmark_pct_2d", "SpiD", "landmark_pct_2d"},
        {"akd", "SpiD", "akd"},
        {"aed", "SpiD", "aed"},
        {"apd", "SpiD", "apd"},
        {"jaw_corr", "SpiD", "jaw_corr"},
        {"blink_corr", "SpiD", "blink_corr"},
        {"cross_colour_to_source", "cross", "colour_to_source"},
        {"cross_colour_to_driver", "cross", "colour_to_driver"},
    };
    struct table copy = *t;

    fputs("{\n", f);
    for (size_t i = 0; i < sizeof flat / sizeof *flat; i++) {
        size_t row = (size_t)-1, col = (size_t)-1;
        for (size_t r = 0; r < t->rows; r++)
            if (!strcmp(t->row[r].name, flat[i].row))
                row = r;
        for (size_t c = 0; c < t->columns; c++)
            if (!strcmp(t->column[c], flat[i].column))
                col = c;
        double x = table_mean(&copy, row, col);
        if (x == x)
            fprintf(f, " \"%s\": %.6g,\n", flat[i].key, x);
        else
            fprintf(f, " \"%s\": null,\n", flat[i].key);
    }
    fputs(" \"rows\": ", f);
    table_write(f, t, TABLE_JSON);
    fputs("}\n", f);
}

static void write_table(const struct table *t, enum table_format format,
                        int model)
{
    char part[PATH];
    int named = strcmp(cli.output, "-") != 0;
    int direct = named && file_is_special(cli.output);
    FILE *f = stdout;

    snprintf(part, sizeof part, direct ? "%s" : "%s.part", cli.output);
    if (named && !(f = fopen(part, "w")))
        die(EX_CANTCREAT, "%s: %s", part, strerror(errno));
    if (model && format == TABLE_JSON)
        write_model_json(f, t);
    else
        table_write(f, t, format);
    if (fflush(f) || ferror(f) || (named && fclose(f))) {
        if (named && !direct)
            unlink(part);
        die(EX_IOERR, "%s: %s", cli.output, strerror(errno));
    }
    if (named && !direct && file_rename(part, cli.output))
        die(EX_CANTCREAT, "%s: %s", cli.output, strerror(errno));
}

/* ---- pairs -------------------------------------------------------------- */

/* Compare one pair into the row; 0, or the exit code after a message. */
static int judge_pair(struct table *t, const char *row, int motion,
                      const char *truth, const char *result,
                      const struct head *h, FILE *tsv, struct lpips *lpips)
{
    struct error err = {0};
    struct compare_log log = {.tsv = tsv, .pair = result};
    size_t r = table_row(t, row);
    int rc = motion ? compare_motions(t, r, truth, result, h, &log, &err)
                    : compare_frames(t, r, truth, result, lpips, &log,
                                     &err);

    if (!rc)
        return 0;
    fprintf(stderr, "spid-eval: %s\n", err.text);
    return err.code ? err.code : EX_SOFTWARE;
}

/* A line of the pairs file into fields; 0 for a comment, -1 when damaged. */
static int split(char *line, char *field[FIELDS])
{
    int n = 0;

    line[strcspn(line, "\r\n")] = 0;
    if (!*line || *line == '#')
        return 0;
    for (char *p = line; p && n < FIELDS; n++) {
        field[n] = p;
        p = strchr(p, '\t');
        if (p)
            *p++ = 0;
    }
    return n >= 4 ? n : -1;
}

/* name, kind (frames or motion), truth, result, and what the row is of. */
static int judge_pairs(struct table *t, const struct head *h, FILE *tsv,
                       struct lpips *lpips)
{
    FILE *f = fopen(opt.pairs, "r");
    char line[4096], row[TABLE_NAME], *field[FIELDS];
    int number = 0, code = 0, failed = 0, done = 0;

    if (!f)
        die(EX_NOINPUT, "%s: %s", opt.pairs, strerror(errno));
    while (fgets(line, sizeof line, f)) {
        int n = split(line, field), motion, rc;
        number++;
        if (n == 0)
            continue;
        if (n < 0)
            die(EX_DATAERR, "%s: line %d: not a pair (expected name, frames "
                "or motion, truth, result and an optional protocol, with "
                "tabs between)", opt.pairs, number);
        motion = !strcmp(field[1], "motion");
        if (!motion && strcmp(field[1], "frames"))
            die(EX_DATAERR, "%s: line %d: %s (expected frames or motion)",
                opt.pairs, number, field[1]);
        snprintf(row, sizeof row, n > 4 ? "%s, %s" : "%s", field[0],
                 n > 4 ? field[4] : "");
        rc = judge_pair(t, row, motion, field[2], field[3], h, tsv, lpips);
        failed += rc != 0;
        code = rc ? rc : code;
        done++;
    }
    fclose(f);
    if (!done)
        die(EX_DATAERR, "%s: no pairs", opt.pairs);
    if (failed)
        warn("%d of %d pairs could not be judged to their end", failed, done);
    return code;
}

/* ---- a model ------------------------------------------------------------ */

static void advance(size_t done, size_t total)
{
    progress("people", done, total, NULL);
}

static int judge_model(struct table *t, const struct head *h)
{
    struct error err = {0};
    struct subject s;
    struct sheet sheet = {0};
    struct people_options po = {
        .stream = opt.people, .people = (size_t)opt.count,
        .frames = (size_t)opt.frames, .stride = (size_t)opt.stride,
        .ablations = !opt.no_ablations, .cross = !opt.no_cross,
        .sheet_rows = !opt.sheet              ? 0
                      : opt.rows < opt.count  ? (size_t)opt.rows
                                              : (size_t)opt.count,
        .progress = advance};
    char path[PATH];
    uint8_t *rgb;
    size_t H, W;
    int rc;

    if (cli_find_model("model.safetensors", path, sizeof path, &err) ||
        subject_init(&s, path, h, &err))
        die_error(&err);
    s.truth = opt.truth;
    rc = people_judge(t, &sheet, &s, &po, &err);
    progress_end();
    subject_release(&s);
    if (rc) {
        fprintf(stderr, "spid-eval: %s\n", err.text);
        return err.code ? err.code : EX_SOFTWARE;
    }
    if (!opt.sheet)
        return 0;
    sheet_take(&sheet, &rgb, &H, &W);
    if (image_write_png(opt.sheet, rgb, W, H, 3, &err))
        die_error(&err);
    free(rgb);
    return 0;
}

int main(int argc, char **argv)
{
    int first = cli_parse(&usage, argc, argv), code, need;
    struct table t;
    struct head h = {0};
    struct lpips lpips = {0};
    struct error err = {0};
    enum table_format format;
    FILE *tsv = NULL;

    if (table_format_parse(&format, opt.format))
        die(EX_USAGE, "--format=%s: unknown (expected text, tsv, json or "
            "latex)", opt.format);
    need = opt.pairs || opt.people ? 0 : 2;
    if (argc - first != need)
        die(EX_USAGE, "%d operands (expected %d; see --help)", argc - first,
            need);
    if (opt.frames_tsv && !(tsv = fopen(opt.frames_tsv, "w")))
        die(EX_CANTCREAT, "%s: %s", opt.frames_tsv, strerror(errno));
    if (opt.lpips && lpips_init(&lpips, opt.lpips, &err))
        die_error(&err);
    table_init(&t);
    load_head(&h, opt.people != NULL);
    if (opt.people)
        code = judge_model(&t, &h);
    else if (opt.pairs)
        code = judge_pairs(&t, h.V ? &h : NULL, tsv, opt.lpips ? &lpips
                                                               : NULL);
    else
        code = judge_pair(&t, opt.name, opt.motion, argv[first],
                          argv[first + 1], h.V ? &h : NULL, tsv,
                          opt.lpips ? &lpips : NULL);
    if (tsv && fclose(tsv))
        die(EX_IOERR, "%s: %s", opt.frames_tsv, strerror(errno));
    if (!code || !opt.people)
        write_table(&t, format, opt.people != NULL);
    table_release(&t);
    if (opt.lpips)
        lpips_release(&lpips);
    head_release(&h);
    stats_write();
    return code;
}
