/* The rows as a table for people, as JSON and as tab-separated lines. */
#include "lib/lab/bench/bench.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"

/* ---- a table for people ------------------------------------------------- */

/* Widths of the first three columns: of the longest words in them. */
struct widths {
    int stage, config, knob;
};

/* The larger of a width and a text's. */
static int report_wider(int width, const char *text)
{
    int n = (int)strlen(text);

    return n > width ? n : width;
}

/* The widths of the columns. */
static struct widths report_measure(const struct bench *b)
{
    struct widths w = {5, 6, 4};

    for (size_t i = 0; i < b->rows; i++) {
        w.stage = report_wider(w.stage, b->row[i].stage);
        w.config = report_wider(w.config, b->row[i].config);
        w.knob = report_wider(w.knob, b->row[i].knob);
    }
    return w;
}

/* A line of the table. */
static void report_put_row(FILE *f, const struct widths *w,
                           const struct bench_row *r)
{
    fprintf(f, "%-*s  %-*s  %-*s %3d %9.3f %9.3f %9.3f ", w->stage, r->stage,
            w->config, r->config, w->knob, r->knob, r->threads, r->ms_min,
            r->ms_median, r->ms_p95);
    if (isnan(r->max_abs))
        fprintf(f, "%10s ", "-");
    else
        fprintf(f, "%10.2e ", r->max_abs);
    if (isnan(r->psnr_db))
        fprintf(f, "%8s", "-");
    else if (r->psnr_db > 1000)
        fprintf(f, "%8s", "same");
    else
        fprintf(f, "%8.1f", r->psnr_db);
    fprintf(f, "  %s\n", r->pareto ? "*" : "");
}

/* The rows under their heading. */
static void report_put_rows(FILE *f, const struct bench *b)
{
    struct widths w = report_measure(b);

    fprintf(f, "%-*s  %-*s  %-*s %3s %9s %9s %9s %10s %8s  %s\n", w.stage,
            "stage", w.config, "config", w.knob, "knob", "thr", "ms min",
            "median", "p95", "max abs", "PSNR dB", "Pareto");
    for (size_t i = 0; i < b->rows; i++)
        report_put_row(f, &w, &b->row[i]);
}

/* A number of the JSON's objects, or NaN. */
static double report_number(const struct bench *b, const char *object,
                            const char *key)
{
    for (size_t i = 0; i < b->pairs; i++)
        if (!strcmp(b->pair[i].object, object) && !strcmp(b->pair[i].key, key))
            return b->pair[i].value;
    return NAN;
}

/* Ours beside the paper's. */
static void report_compare(FILE *f, const char *what, double ours,
                           double paper)
{
    fprintf(f, "%-30s", what);
    if (isnan(ours))
        fprintf(f, " %9s", "-");
    else
        fprintf(f, " %9.2f", ours);
    if (isnan(paper))
        fprintf(f, " %9s\n", "-");
    else
        fprintf(f, " %9.1f\n", paper);
}

/* The paper's Section 4.4 (one A100) beside what was measured here. */
static void report_put_paper(FILE *f, const struct bench *b)
{
    double motion = report_number(b, "ms", "motion");
    double render =
        report_number(b, "ms", "branches") + report_number(b, "ms", "splat");

    if (isnan(report_number(b, "fps", "spid_star")))
        return;
    fprintf(f, "\n%-30s %9s %9s\n", "Phase B, ms a frame", "here",
            "paper");
    report_compare(f, "face crop", report_number(b, "ms", "crop"), 0.2);
    report_compare(f, "motion encoder and heads", motion, 2.1);
    report_compare(f, "head mesh", report_number(b, "ms", "flame"), 1.3);
    report_compare(f, "Gaussians: move and draw", render, 1.5);
    report_compare(f, "draw 32 channels (SpiD)",
                   report_number(b, "ms", "splat_features"), NAN);
    report_compare(f, "refine (SpiD)", report_number(b, "ms", "refine"),
                   NAN);
    report_compare(f, "decode (video rows)",
                   report_number(b, "ms", "decode"), NAN);
    report_compare(f, "encode (video rows)",
                   report_number(b, "ms", "encode"), NAN);
    report_compare(f, "sum of the first four",
                   report_number(b, "ms", "crop") + motion +
                       report_number(b, "ms", "flame") + render,
                   5.1);
    fprintf(f, "%-30s %9s %9s\n", "frames a second", "", "");
    report_compare(f, "SpiD*", report_number(b, "fps", "spid_star"), 154);
    report_compare(f, "SpiD", report_number(b, "fps", "spid"), 43);
    report_compare(f, "SpiD*, video to video",
                   report_number(b, "fps", "spid_star_video"), NAN);
    report_compare(f, "SpiD, video to video",
                   report_number(b, "fps", "spid_video"), NAN);
    fprintf(f, "Here: this processor, %d thread%s; a stage's ms are of one "
            "worker's core, and as\nmany frames are under way as there are "
            "threads.  Paper: one A100; its parts add up to\n5.1 ms where its "
            "text says 6.1.\n", b->threads, plural(b->threads));
}

char *bench_table(const struct bench *b)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    if (!f)
        return NULL;
    fprintf(f, "%s, %s, %d thread%s\n", cpu_name(),
            cpu_level_name(cpu_level()), b->threads,
            plural(b->threads));
    report_put_rows(f, b);
    report_put_paper(f, b);
    if (b->notes)
        fprintf(f, "\n%s", b->notes);
    if (fclose(f)) {
        free(text);
        return NULL;
    }
    return text;
}

/* ---- for programs ------------------------------------------------------- */

/* A row as a JSON object; NaN is null. */
static void report_add_row(cJSON *rows, const struct bench_row *r)
{
    cJSON *o = cJSON_CreateObject();

    cJSON_AddStringToObject(o, "stage", r->stage);
    cJSON_AddStringToObject(o, "config", r->config);
    cJSON_AddStringToObject(o, "knob", r->knob);
    cJSON_AddNumberToObject(o, "threads", r->threads);
    cJSON_AddNumberToObject(o, "ms_min", r->ms_min);
    cJSON_AddNumberToObject(o, "ms_median", r->ms_median);
    cJSON_AddNumberToObject(o, "ms_p95", r->ms_p95);
    cJSON_AddNumberToObject(o, "max_abs", r->max_abs);
    cJSON_AddNumberToObject(o, "psnr_db", r->psnr_db);
    cJSON_AddBoolToObject(o, "pareto", r->pareto);
    cJSON_AddItemToArray(rows, o);
}

char *bench_json(const struct bench *b)
{
    cJSON *root = cJSON_CreateObject();
    cJSON *machine = cJSON_AddObjectToObject(root, "machine");

    cJSON_AddStringToObject(machine, "cpu", cpu_name());
    cJSON_AddStringToObject(machine, "isa", cpu_level_name(cpu_level()));
    cJSON_AddNumberToObject(machine, "threads", b->threads);
    cJSON *rows = cJSON_AddArrayToObject(root, "rows");

    for (size_t i = 0; i < b->rows; i++)
        report_add_row(rows, &b->row[i]);
    for (size_t i = 0; i < b->pairs; i++) {
        const struct bench_pair *p = &b->pair[i];
        cJSON *o = cJSON_GetObjectItemCaseSensitive(root, p->object);

        cJSON_AddNumberToObject(
            o ? o : cJSON_AddObjectToObject(root, p->object), p->key,
            p->value);
    }
    char *text = cJSON_Print(root);

    cJSON_Delete(root);
    return text;
}

/* A tab-separated field. */
static void report_put_cell(FILE *f, double v)
{
    if (isfinite(v))
        fprintf(f, "\t%.6g", v);
    else
        fputs("\tNA", f);
}

char *bench_tsv(const struct bench *b)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    if (!f)
        return NULL;
    fprintf(f, "# cpu\t%s\n# isa\t%s\n# threads\t%d\n", cpu_name(),
            cpu_level_name(cpu_level()), b->threads);
    for (size_t i = 0; i < b->pairs; i++)
        fprintf(f, "# %s.%s\t%.6g\n", b->pair[i].object, b->pair[i].key,
                b->pair[i].value);
    fputs("stage\tconfig\tknob\tthreads\tms_min\tms_median\tms_p95\tmax_abs"
          "\tpsnr_db\tpareto\n", f);
    for (size_t i = 0; i < b->rows; i++) {
        const struct bench_row *r = &b->row[i];

        fprintf(f, "%s\t%s\t%s\t%d", r->stage, r->config, r->knob,
                r->threads);
        report_put_cell(f, r->ms_min);
        report_put_cell(f, r->ms_median);
        report_put_cell(f, r->ms_p95);
        report_put_cell(f, r->max_abs);
        report_put_cell(f, r->psnr_db);
        fprintf(f, "\t%d\n", r->pareto);
    }
    if (fclose(f)) {
        free(text);
        return NULL;
    }
    return text;
}
