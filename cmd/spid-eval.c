/* spid-eval: how far results are from the truth, as the paper's tables. */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cmd/options.h"
#include "formats/image.h"
#include "lib/base/file.h"
#include "lib/eval/compare.h"
#include "lib/eval/people.h"

#define PATH 600
#define FIELDS 6 /* of a pairs file: name, kind, truth, result, protocol,
                  * source */

static struct {
    const char *format, *name, *pairs, *frames_tsv, *people, *sheet, *head;
    const char *lpips, *arcface, *source;
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
    {.name = "arcface", .kind = CLI_STRING, .dest = &opt.arcface,
     .arg = "FILE", .help = "weights of an iresnet: adds the column arcface"},
    {.name = "source", .kind = CLI_STRING, .dest = &opt.source,
     .arg = "PICTURE",
     .help = "--arcface: who it shall be, adds the column arcface_src"},
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
    OPTION_HEAD(&opt.head),
    {.name = NULL},
};

static const struct cli_usage usage = {
    .program = "spid-eval",
    .synopsis = "[OPTION ...] [TRUTH RESULT]",
    .purpose = "the paper's metrics of frames, motions or a whole model",
    .options = options,
};

/* What pairs are judged with. */
struct judge {
    struct head head;           /* V 0: none found */
    struct lpips lpips;
    struct likeness likeness;
    struct compare_nets nets;
    FILE *tsv;
    bool self, cross;           /* protocols that rows name */
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

/* The protocols of the rows, so that a table says what it shows. */
static void write_protocols(FILE *f, const struct judge *j,
                            enum table_format format)
{
    const char *mark = format == TABLE_LATEX ? "% " : "# ";

    if (format == TABLE_JSON)
        return;
    if (j->self)
        fprintf(f, "%sself: the source is the first frame of a clip, the "
                "driver that clip, the truth its frames\n", mark);
    if (j->cross)
        fprintf(f, "%scross: the source is the first frame of a clip, the "
                "driver the next identity's clip, the truth the driver's "
                "motion\n", mark);
}

static void write_table(const struct table *t, enum table_format format,
                        const struct judge *j)
{
    int model = opt.people != NULL;
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
    write_protocols(f, j, format);
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
                      const char *source, const struct judge *j)
{
    struct error err = {0};
    struct compare_log log = {.tsv = j->tsv, .pair = result};
    size_t r = table_row(t, row);
    int rc = motion ? compare_motions(t, r, truth, result,
                                      j->head.V ? &j->head : NULL, &log, &err)
                    : compare_frames(t, r, truth, result, source, &j->nets,
                                     &log, &err);

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

/* name, kind (frames or motion), truth, result, what the row is of, and the
 * picture the result was made of. */
static int judge_pairs(struct table *t, struct judge *j)
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
                "or motion, truth, result and, optional, protocol and "
                "source, with tabs between)", opt.pairs, number);
        motion = !strcmp(field[1], "motion");
        if (!motion && strcmp(field[1], "frames"))
            die(EX_DATAERR, "%s: line %d: %s (expected frames or motion)",
                opt.pairs, number, field[1]);
        snprintf(row, sizeof row, n > 4 ? "%s, %s" : "%s", field[0],
                 n > 4 ? field[4] : "");
        j->self |= n > 4 && !strcmp(field[4], "self");
        j->cross |= n > 4 && !strcmp(field[4], "cross");
        rc = judge_pair(t, row, motion, field[2], field[3],
                        n > 5 ? field[5] : NULL, j);
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
    struct model model;
    uint8_t *rgb;
    size_t H, W;
    int rc;

    if (option_model_open(&model, &err) ||
        subject_init(&s, &model, h, &err))
        die_error(&err);
    model_close(&model);
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

static void open_judge(struct judge *j)
{
    struct error err = {0};
    struct model model = {0};

    if (opt.frames_tsv && !(j->tsv = fopen(opt.frames_tsv, "w")))
        die(EX_CANTCREAT, "%s: %s", opt.frames_tsv, strerror(errno));
    load_head(&j->head, opt.people != NULL);
    if (opt.lpips) {
        if (lpips_init(&j->lpips, opt.lpips, &err))
            die_error(&err);
        j->nets.lpips = &j->lpips;
    }
    if (opt.arcface) {
        bool found = option_model_open(&model, &err) == 0;

        if ((!found && err.code != EX_NOINPUT) ||
            likeness_init(&j->likeness, opt.arcface, found ? &model : NULL,
                          j->head.V ? &j->head : NULL, &err))
            die_error(&err);
        model_close(&model);
        j->nets.likeness = &j->likeness;
    }
}

static void close_judge(struct judge *j)
{
    if (j->tsv && fclose(j->tsv))
        die(EX_IOERR, "%s: %s", opt.frames_tsv, strerror(errno));
    if (j->nets.lpips)
        lpips_release(&j->lpips);
    if (j->nets.likeness)
        likeness_release(&j->likeness);
    head_release(&j->head);
}

int main(int argc, char **argv)
{
    static struct judge j;
    int first = cli_parse(&usage, argc, argv), code;
    int need = opt.pairs || opt.people ? 0 : 2;
    enum table_format format;
    struct table t;

    if (table_format_parse(&format, opt.format))
        die(EX_USAGE, "--format=%s: unknown (expected text, tsv, json or "
            "latex)", opt.format);
    if (argc - first != need)
        die(EX_USAGE, "%d operands (expected %d; see --help)", argc - first,
            need);
    if (opt.source && !opt.arcface)
        die(EX_USAGE, "--source is for --arcface");
    open_judge(&j);
    table_init(&t);
    if (opt.people)
        code = judge_model(&t, &j.head);
    else if (opt.pairs)
        code = judge_pairs(&t, &j);
    else
        code = judge_pair(&t, opt.name, opt.motion, argv[first],
                          argv[first + 1], opt.source, &j);
    if (!code || !opt.people)
        write_table(&t, format, &j);
    table_release(&t);
    close_judge(&j);
    stats_write();
    return code;
}
