/* spid-eval: how far results are from the truth, as the paper's tables. */
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "cmd/lab/eval_output.h"
#include "cmd/options.h"
#include "formats/outfile.h"
#include "lib/lab/eval/compare.h"
#include "lib/lab/eval/distribution.h"
#include "lib/lab/eval/pairs.h"
#include "lib/lab/eval/people.h"

static struct {
    const char *format, *pairs, *frames_tsv, *people, *sheet, *head;
    const char *lpips, *arcface, *musiq, *topiq, *source;
    unsigned truth;
    bool motion, features, no_ablations, no_cross;
    long count, frames;
} opt = {.format = "text", .count = 40, .frames = 25};

static const struct cli_option options[] = {
    OPTION_STRING("format", 'f', &opt.format, "KIND",
                  "text, tsv, json or latex (default text)"),
    OPTION_FLAG("motion", 0, &opt.motion,
                "TRUTH and RESULT are motion streams, not frames"),
    OPTION_FLAG("features", 0, &opt.features,
                "TRUTH and RESULT are features (.npy): columns fid and kid"),
    OPTION_STRING("pairs", 0, &opt.pairs, "FILE",
                  "compare every pair the file lists"),
    OPTION_OUTPUT("frames-tsv", 0, &opt.frames_tsv, "FILE",
                  "write the figures of every frame there"),
    OPTION_STRING("lpips", 0, &opt.lpips, "FILE",
                  "AlexNet and LPIPS weights: adds the column lpips"),
    OPTION_STRING("arcface", 0, &opt.arcface, "FILE",
                  "weights of an iresnet: adds the column arcface"),
    OPTION_STRING("musiq", 0, &opt.musiq, "FILE",
                  "weights of MUSIQ: adds the column musiq"),
    OPTION_STRING("topiq", 0, &opt.topiq, "FILE",
                  "weights of TopIQ: adds the column topiq"),
    OPTION_STRING("source", 0, &opt.source, "PICTURE",
                  "--arcface: who it shall be, adds the column arcface_src"),
    OPTION_STRING("people", 0, &opt.people, "STREAM",
                  "evaluate the model on people of spid-synth"),
    OPTION_INT("count", 0, &opt.count, 1, 100000, "N",
               "--people: how many (default 40)"),
    OPTION_INT("frames", 0, &opt.frames, 2, 100000, "N",
               "--people: of each, the source included (default 25)"),
    OPTION_FLAG("no-ablations", 0, &opt.no_ablations,
                "--people: leave the ablations out"),
    OPTION_FLAG("no-cross", 0, &opt.no_cross,
                "--people: leave cross-reenactment out"),
    OPTION_CALL("known", 0, &opt.truth, "WHAT", reenactor_parse_truth,
                "--people: the true shape or motion, not the encoder's"),
    OPTION_OUTPUT("sheet", 0, &opt.sheet, "FILE",
                  "--people: contact sheet (PNG)"),
    OPTION_HEAD(&opt.head),
    {0}
};

static const struct cli_usage usage = {
    "spid-eval", "[OPTION ...] [TRUTH RESULT]",
    "the paper's metrics of frames, motions or a whole model", options
};

/* What pairs are compared with. */
struct comparison {
    struct head head;           /* V 0: none found */
    struct lpips lpips;
    struct likeness likeness;
    struct musiq musiq;
    struct topiq topiq;
    struct compare_nets nets;
    struct outfile tsv;         /* --frames-tsv */
    unsigned protocols;         /* that rows name */
};

/* The head of --head, or the one that is found; V is 0 when it may be missing
 * and is. */
static void eval_load_head(struct head *h, bool required)
{
    struct error err = {0};

    if (option_head_load(h, opt.head, &err) &&
        (required || opt.head || err.code != EX_NOINPUT))
        die_error(&err);
}

/* The message on standard error; the exit code. */
static int eval_print_error(const struct error *err)
{
    fprintf(stderr, "spid-eval: %s\n", err->text);
    return err->code ? err->code : EX_SOFTWARE;
}

/* ---- pairs -------------------------------------------------------------- */

/* Compare one pair into the row; 0, or the exit code after a message.  A list's
 * frames of one person have a null line: their first frame, unchanged. */
static int eval_compare_pair(struct table *t, const char *row,
                             const struct pair *p, struct comparison *j)
{
    struct error err = {0};
    struct compare_log log = {.tsv = j->tsv.file, .pair = p->result};
    struct compare_rows rows = {table_row(t, row), TABLE_NO_ROW};
    const unsigned protocol = protocol_parse(p->protocol);
    char still[TABLE_NAME];
    int rc;

    snprintf(still, sizeof still, p->protocol ? "%s, %s" : "%s",
             PAIRS_UNCHANGED, p->protocol);
    j->protocols |= protocol;
    if (opt.pairs && !p->motion && protocol != PROTOCOL_CROSS) {
        rows.unchanged = table_row(t, still);
        j->protocols |= PROTOCOL_UNCHANGED;
    }
    rc = p->motion ? compare_motions(t, rows.result, p->truth, p->result,
                                     j->head.V ? &j->head : NULL, &log, &err)
                   : compare_frames(t, &rows, p, &j->nets, &log, &err);
    return rc ? eval_print_error(&err) : 0;
}

/* Every pair of --pairs; 0, or the last exit code. */
static int eval_compare_pairs(struct table *t, struct comparison *j)
{
    struct error err = {0};
    struct pairs list;
    char row[TABLE_NAME];
    int code = 0;
    size_t failed = 0;

    if (pairs_read(&list, opt.pairs, &err))
        die_error(&err);
    for (size_t i = 0; i < list.count; i++) {
        const struct pair *p = &list.pair[i];
        int rc;

        snprintf(row, sizeof row, p->protocol ? "%s, %s" : "%s", p->name,
                 p->protocol);
        rc = eval_compare_pair(t, row, p, j);
        failed += rc != 0;
        code = rc ? rc : code;
    }
    if (failed)
        warn("%zu of %zu pairs could not be compared to their end", failed,
             list.count);
    pairs_release(&list);
    return code;
}

/* ---- a model ------------------------------------------------------------ */

static void eval_print_progress(size_t done, size_t total)
{
    progress("people", done, total, NULL);
}

/* --people: 0, or the exit code. */
static int eval_model(struct table *t, const struct comparison *j)
{
    struct error err = {0};
    struct reenactor s;
    struct contact_sheet sheet = {0};
    struct people_options po = {.stream = opt.people,
                                .people = (size_t)opt.count,
                                .frames = (size_t)opt.frames,
                                .ablations = !opt.no_ablations,
                                .cross = !opt.no_cross,
                                .lpips = j->nets.lpips,
                                .progress = eval_print_progress};
    struct model model;
    int rc;

    if (option_model_open(&model, &err) ||
        reenactor_init(&s, &model, &j->head, &err))
        die_error(&err);
    s.truth = opt.truth;
    rc = people_evaluate(t, opt.sheet ? &sheet : NULL, &s, &po, &err);
    progress_end();
    reenactor_release(&s);
    model_close(&model);
    if (rc)
        return eval_print_error(&err);
    if (opt.sheet && contact_sheet_save(&sheet, opt.sheet, &err))
        die_error(&err);
    return 0;
}

/* The file of frames, the head and the networks that were asked for. */
static void eval_open_comparison(struct comparison *j)
{
    struct error err = {0};
    struct model model = {0};

    if (opt.frames_tsv && outfile_open(&j->tsv, opt.frames_tsv, &err))
        die_error(&err);
    eval_load_head(&j->head, opt.people != NULL);
    if ((opt.lpips &&
         lpips_init(&j->lpips, LPIPS_ALEXNET, opt.lpips, &err)) ||
        (opt.musiq && musiq_init(&j->musiq, opt.musiq, &err)) ||
        (opt.topiq && topiq_init(&j->topiq, opt.topiq, &err)))
        die_error(&err);
    j->nets = (struct compare_nets){
        .lpips = opt.lpips ? &j->lpips : NULL,
        .likeness = opt.arcface ? &j->likeness : NULL,
        .musiq = opt.musiq ? &j->musiq : NULL,
        .topiq = opt.topiq ? &j->topiq : NULL
    };
    if (opt.arcface) {
        bool found = option_model_open(&model, &err) == 0;

        if ((!found && err.code != EX_NOINPUT) ||
            likeness_init(&j->likeness, opt.arcface, found ? &model : NULL,
                          j->head.V ? &j->head : NULL, &err))
            die_error(&err);
        model_close(&model);
    }
}

static void eval_close_comparison(struct comparison *j)
{
    struct error err = {0};

    if (j->tsv.file && outfile_close(&j->tsv, &err))
        die_error(&err);
    lpips_release(&j->lpips);
    musiq_release(&j->musiq);
    topiq_release(&j->topiq);
    likeness_release(&j->likeness);
    head_release(&j->head);
}

int main(int argc, char **argv)
{
    static struct comparison j;
    int first = cli_parse(&usage, argc, argv), code;
    int need = opt.pairs || opt.people ? 0 : 2;
    enum table_format format;
    struct error err = {0};
    struct table t;

    if (table_format_parse(&format, opt.format))
        die(EX_USAGE, "--format=%s: unknown (expected text, tsv, json or "
            "latex)", opt.format);
    if (argc - first != need)
        die(EX_USAGE, "%d operand%s (expected %d; see --help)", argc - first,
            plural((unsigned)(argc - first)), need);
    if (opt.source && !opt.arcface)
        die(EX_USAGE, "--source is for --arcface");
    eval_open_comparison(&j);
    table_init(&t);
    if (opt.people)
        code = eval_model(&t, &j);
    else if (opt.pairs)
        code = eval_compare_pairs(&t, &j);
    else if (opt.features)
        code = distribution_compare(&t, table_row(&t, "result"), argv[first],
                                    argv[first + 1], &err)
                   ? eval_print_error(&err) : 0;
    else
        code = eval_compare_pair(&t, "result", &(struct pair){
            .motion = opt.motion, .truth = argv[first],
            .result = argv[first + 1], .source = opt.source}, &j);
    if (!code || !opt.people)
        eval_output_write(&t, &(struct eval_output){
            .format = format, .summary = opt.people != NULL,
            .protocols = j.protocols, .nets = opt.pairs ? &j.nets : NULL});
    table_release(&t);
    eval_close_comparison(&j);
    stats_write();
    return code;
}
