/* The picture of a bench, what a millisecond costs in accuracy, as a script for
 * gnuplot: a panel for each of the stages with most to compare. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/file.h"

enum { PANELS = 4, STAGES = 16, GROUPS = 64 };
#define FLOOR 1e-9      /* RMS error at which smaller ones, and none, are drawn */

/* A stage's rows, in groups of one configuration. */
struct panel {
    const char *stage;
    const struct bench_row *group[GROUPS];
    int groups;
    size_t rows;
};

/* Whether a row is drawn: it has an error, and of rows timed with several
 * numbers of threads the most. */
static bool plot_is_drawn(const struct bench *b, const struct bench_row *r)
{
    for (size_t i = 0; i < b->rows; i++) {
        const struct bench_row *o = &b->row[i];

        if (!strcmp(o->stage, r->stage) && !strcmp(o->config, r->config) &&
            !strcmp(o->knob, r->knob) && o->threads > r->threads)
            return false;
    }
    return !isnan(r->psnr_db) && r->ms_min > 0;
}

/* Count row r in its stage's panel of the n; returns how many there are now. */
static size_t plot_add_row(struct panel *p, size_t n, const struct bench_row *r)
{
    size_t k = 0;
    int g = 0;

    while (k < n && strcmp(p[k].stage, r->stage))
        k++;
    if (k == STAGES)
        return n;
    p[k].stage = r->stage;
    p[k].rows++;
    while (g < p[k].groups && !bench_same_group(p[k].group[g], r))
        g++;
    if (g == p[k].groups && g < GROUPS)
        p[k].group[p[k].groups++] = r;
    return k < n ? n : n + 1;
}

/* Order of qsort: most rows first. */
static int plot_by_rows(const void *a, const void *b)
{
    const struct panel *p = a, *q = b;

    return p->rows > q->rows ? -1 : p->rows < q->rows;
}

/* Order of qsort: the Pareto front first, then fastest first. */
static int plot_by_time(const void *a, const void *b)
{
    const struct bench_row *p = *(const struct bench_row *const *)a;
    const struct bench_row *q = *(const struct bench_row *const *)b;

    if (p->pareto != q->pareto)
        return q->pareto - p->pareto;
    return p->ms_min < q->ms_min ? -1 : p->ms_min > q->ms_min;
}

/* Text for gnuplot's double quotes. */
static void plot_put_quoted(FILE *f, const char *s)
{
    fputc('"', f);
    for (; *s; s++) {
        if (*s == '"' || *s == '\\')
            fputc('\\', f);
        fputc(*s, f);
    }
    fputc('"', f);
}

/* Lines of a data block, those of group g: its number, time, RMS error, which
 * side the label is on (0, 1; 2: off the front, no label), the knob. */
static void plot_put_points(FILE *f, const struct bench *b,
                            const struct panel *p, int g,
                            const struct bench_row **row)
{
    size_t n = 0;

    for (size_t i = 0; i < b->rows; i++)
        if (bench_same_group(p->group[g], &b->row[i]) &&
            plot_is_drawn(b, &b->row[i]))
            row[n++] = &b->row[i];
    qsort(row, n, sizeof *row, plot_by_time);
    for (size_t i = 0; i < n; i++) {
        fprintf(f, "%d %.6g %.6g %d ", g, row[i]->ms_min,
                fmax(pow(10, -row[i]->psnr_db / 20), FLOOR),
                row[i]->pareto ? (int)(i % 2) : 2);
        plot_put_quoted(f, row[i]->knob);
        fputc('\n', f);
    }
}

/* Points filled and joined on the front, hollow off it, a colour and a title
 * for each group; the front's labels, to either side in turn. */
static void plot_put_curves(FILE *f, const struct panel *p)
{
    for (int g = 0; g < p->groups; g++) {
        const struct bench_row *r = p->group[g];

        fprintf(f, "%s $rows using 2:($1 == %d && $4 < 2 ? $3 : NaN) with "
                "linespoints pt 7 lc %d title \"%s, %d thread%s\", \\\n"
                "    $rows using 2:($1 == %d && $4 == 2 ? $3 : NaN) with "
                "points pt 6 lc %d notitle", g ? ", \\\n   " : "plot", g, g + 1,
                r->config, r->threads, plural(r->threads), g, g + 1);
    }
    fputs(", \\\n    $rows using 2:($4 == 0 ? $3 : NaN):5 with labels left "
          "offset 0.8,0.4 notitle, \\\n    $rows using 2:($4 == 1 ? $3 : NaN)"
          ":5 with labels right offset -0.8,-0.4 notitle\n", f);
}

/* gnuplot's terminal for the name's ending. */
static const char *plot_terminal(const char *file)
{
    if (file_ends(file, ".svg"))
        return "svg size 1800,1200 background \"white\" font \"Sans,11\"";
    if (file_ends(file, ".pdf"))
        return "pdfcairo size 18,12 font \"Sans,11\" fontscale 1.35";
    return "pngcairo size 1800,1200 font \"Sans,11\"";
}

/* The whole script. */
static int plot_put_script(FILE *f, const struct panel *p, size_t n,
                           const char *file, const struct bench *b)
{
    const struct bench_row **row = calloc(b->rows, sizeof *row);

    if (!row)
        return -1;
    fprintf(f, "set terminal %s\nset output ", plot_terminal(file));
    plot_put_quoted(f, file);
    fprintf(f, "\nset termoption noenhanced\nset multiplot layout %d,%d title "
            "\"What a millisecond costs in accuracy.  Filled and joined: the "
            "Pareto front.  %s, %s, %d thread%s\"\n", n > 2 ? 2 : 1,
            n > 1 ? 2 : 1, cpu_name(), cpu_level_name(cpu_level()), b->threads,
            plural(b->threads));
    fputs("set logscale xy 10\nset format y \"%.0e\"\nset grid\n"
          "set autoscale xfix\nset autoscale yfix\n"
          "set offsets graph 0.2, graph 0.2, graph 0.1, graph 0.1\n"
          "set key below left reverse Left maxcols 1\n"
          "set xlabel \"milliseconds a call (least)\"\n"
          "set xtics (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, "
          "100, 200, 500, 1000, 2000, 5000, 10000)\n"
          "set ylabel \"RMS error\"\n", f);
    for (size_t i = 0; i < n; i++) {
        fprintf(f, "set title \"%s\"\n$rows << END\n", p[i].stage);
        for (int g = 0; g < p[i].groups; g++)
            plot_put_points(f, b, &p[i], g, row);
        fputs("END\n", f);
        plot_put_curves(f, &p[i]);
    }
    fputs("unset multiplot\n", f);
    free(row);
    return 0;
}

char *bench_plot(const struct bench *b, const char *file, struct error *err)
{
    struct panel p[STAGES] = {{0}};
    char *text = NULL;
    size_t size, n = 0, panels = 0;

    for (size_t i = 0; i < b->rows; i++)
        if (plot_is_drawn(b, &b->row[i]))
            n = plot_add_row(p, n, &b->row[i]);
    qsort(p, n, sizeof *p, plot_by_rows);
    while (panels < n && panels < PANELS && p[panels].rows > 1)
        panels++;
    if (panels == 0)
        return error_null(err, EX_DATAERR, "%s: no two rows have an error to "
                          "draw (expected a stage such as splat, motion or "
                          "refine)", file);
    FILE *f = open_memstream(&text, &size);
    const int failed = !f || plot_put_script(f, p, panels, file, b);

    if ((f && fclose(f)) || failed) {
        free(text);
        text = NULL;
        error_set(err, EX_OSERR, "out of memory");
    }
    return text;
}
