/* The picture of a bench: what a millisecond costs in accuracy.  Labels are
 * placed here, because gnuplot lets them cover each other. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"

enum { WIDE = 1800, HIGH = 1200, MAX = 200, GLYPH = 7, LINE = 15 };
enum { PANELS = 4 };            /* a wide one, three below it */
#define FLOOR -9                /* errors below 1e-9 are drawn at the bottom */

struct box {
    double x0, y0, x1, y1;      /* pixels, y upwards */
};

struct mark {
    const struct bench_row *row;
    double x, y;                /* log10 of milliseconds and of RMS error */
    double px, py;
    bool none;                  /* no error, or too small to matter: drawn at
                                 * the bottom */
    int group;
};

struct panel {
    const char *title;          /* a stage's name */
    struct box frame;           /* pixels */
    double x0, x1, y0, y1;      /* log10 */
    struct mark mark[MAX];
    size_t marks;
    const struct bench_row *group[MAX];
    int groups;
    struct box taken[2 * MAX]; /* by points and labels */
    size_t takens;
};

/* ---- what is drawn ------------------------------------------------------ */

/* Rows of one curve. */
static bool plot_same_group(const struct bench_row *a,
                            const struct bench_row *b)
{
    return !strcmp(a->stage, b->stage) && !strcmp(a->config, b->config) &&
           a->threads == b->threads;
}

/* A row with an error. */
static bool plot_comparable(const struct bench_row *r)
{
    return !isnan(r->psnr_db) && r->ms_min > 0;
}

/* Of rows timed with several numbers of threads the most stay: one picture of
 * a knob is enough. */
static bool plot_max_threads(const struct bench *b, const struct bench_row *r)
{
    for (size_t i = 0; i < b->rows; i++) {
        const struct bench_row *o = &b->row[i];

        if (!strcmp(o->stage, r->stage) && !strcmp(o->config, r->config) &&
            !strcmp(o->knob, r->knob) && o->threads > r->threads)
            return false;
    }
    return true;
}

/* A stage's rows as marks, a group for each curve. */
static void plot_gather(struct panel *p, const struct bench *b,
                        const char *stage)
{
    p->title = stage;
    for (size_t i = 0; i < b->rows && p->marks < MAX; i++) {
        const struct bench_row *r = &b->row[i];
        double y = -r->psnr_db / 20;
        int g = 0;

        if (strcmp(stage, r->stage) || !plot_comparable(r) || !plot_max_threads(b, r))
            continue;
        while (g < p->groups && !plot_same_group(p->group[g], r))
            g++;
        if (g == p->groups)
            p->group[p->groups++] = r;
        p->mark[p->marks++] = (struct mark){r, log10(r->ms_min), y, 0, 0,
                                            y < FLOOR, g};
    }
}

/* Order of qsort: most marks first. */
static int plot_by_marks(const void *a, const void *b)
{
    const struct panel *p = a, *q = b;

    return p->marks > q->marks ? -1 : p->marks < q->marks;
}

/* The stages with most to compare. */
static size_t plot_choose(struct panel *p, const struct bench *b)
{
    size_t n = 0;

    for (size_t i = 0; i < b->rows && n < 32; i++) {
        size_t k = 0;

        while (k < n && strcmp(p[k].title, b->row[i].stage))
            k++;
        if (k < n)
            continue;
        plot_gather(&p[n], b, b->row[i].stage);
        if (p[n].marks >= 2)
            n++;
        else
            memset(&p[n], 0, sizeof p[n]);
    }
    qsort(p, n, sizeof *p, plot_by_marks);
    return n > PANELS ? PANELS : n;
}

/* lo and hi such that x lies between them. */
static void plot_widen(double *lo, double *hi, double x)
{
    *lo = fmin(*lo, x);
    *hi = fmax(*hi, x);
}

/* Remember that a box of the panel holds something. */
static void plot_take(struct panel *p, struct box b)
{
    if (p->takens < 2 * MAX)
        p->taken[p->takens++] = b;
}

/* Ranges of a panel's axes, and where its marks lie in its frame. */
static void plot_lay_out(struct panel *p, struct box frame)
{
    double xlo = INFINITY, xhi = -INFINITY, ylo = INFINITY, yhi = -INFINITY;

    p->frame = frame;
    for (size_t i = 0; i < p->marks; i++) {
        plot_widen(&xlo, &xhi, p->mark[i].x);
        if (!p->mark[i].none)
            plot_widen(&ylo, &yhi, p->mark[i].y);
    }
    if (ylo > yhi)                          /* nothing but equal results */
        ylo = yhi = FLOOR;
    /* room for labels: a quarter of the width, at least a third of a decade */
    double room = fmax(0.3, 0.25 * (xhi - xlo));
    p->x0 = xlo - room;
    p->x1 = xhi + room;
    p->y0 = ylo - fmax(0.3, 0.2 * (yhi - ylo));
    p->y1 = yhi + fmax(0.2, 0.1 * (yhi - ylo));
    for (size_t i = 0; i < p->marks; i++) {
        struct mark *m = &p->mark[i];

        if (m->none)
            m->y = p->y0;
        m->px = frame.x0 + (m->x - p->x0) / (p->x1 - p->x0) *
                               (frame.x1 - frame.x0);
        m->py = frame.y0 + (m->y - p->y0) / (p->y1 - p->y0) *
                               (frame.y1 - frame.y0);
        plot_take(p, (struct box){m->px - 6, m->py - 6, m->px + 6, m->py + 6});
    }
}

/* ---- labels ------------------------------------------------------------- */

/* How much of a box is taken already, or outside the panel. */
static double plot_overlap(const struct panel *p, struct box b)
{
    double sum = 0;

    for (size_t i = 0; i < p->takens; i++) {
        const struct box *t = &p->taken[i];
        double w = fmin(b.x1, t->x1) - fmax(b.x0, t->x0);
        double h = fmin(b.y1, t->y1) - fmax(b.y0, t->y0);

        if (w > 0 && h > 0)
            sum += w * h;
    }
    if (b.x0 < p->frame.x0 + 3 || b.x1 > p->frame.x1 - 3 ||
        b.y0 < p->frame.y0 + 3 || b.y1 > p->frame.y1 - 3)
        sum += 1e4;
    return sum;
}

/* The first free place about the point, from near to far. */
static struct box plot_place(const struct panel *p, const struct mark *m,
                             const char *text)
{
    static const double direction[][2] = {
        {1, 0}, {-1, 0}, {0.5, 1}, {0.5, -1}, {-0.5, 1}, {-0.5, -1}, {1, 1},
        {1, -1}, {-1, 1}, {-1, -1}};
    double w = (double)strlen(text) * GLYPH, best = INFINITY;
    struct box found = {0};

    for (double far = 10; far < 150 && best > 0; far += 10)
        for (size_t k = 0; k < 10 && best > 0; k++) {
            double dx = direction[k][0], dy = direction[k][1];
            double cx = m->px + dx * far + (dx > 0.6   ? w / 2
                                            : dx < -0.6 ? -w / 2
                                                        : dx * w / 2);
            double cy = m->py + dy * far;
            struct box b = {cx - w / 2, cy - LINE / 2.0, cx + w / 2,
                            cy + LINE / 2.0};
            double bad = plot_overlap(p, b) + far * 1e-9;

            if (bad < best - 1e-6) {
                best = bad < 1e-6 ? 0 : bad;
                found = b;
            }
        }
    return found;
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

/* A mark's label at the best place, with a line to it when far. */
static void plot_put_label(FILE *f, struct panel *p, const struct mark *m)
{
    char text[80];

    snprintf(text, sizeof text, "%s%s", m->row->knob,
             !m->none                  ? ""
             : m->row->psnr_db < 1000 ? " (under 1e-9)"
                                      : " (the reference)");
    struct box b = plot_place(p, m, text);
    double cx = (b.x0 + b.x1) / 2, cy = (b.y0 + b.y1) / 2;
    double gap = hypot(fmax(0, fabs(cx - m->px) - (b.x1 - b.x0) / 2),
                       fmax(0, fabs(cy - m->py) - LINE / 2.0));

    plot_take(p, b);
    if (gap > 14)
        fprintf(f, "set arrow from screen %.5f,%.5f to screen %.5f,%.5f nohead "
                "lc rgb \"#b0b0b0\" lw 0.7\n", m->px / WIDE, m->py / HIGH,
                fmin(fmax(m->px, b.x0), b.x1) / WIDE,
                fmin(fmax(m->py, b.y0), b.y1) / HIGH);
    fputs("set label ", f);
    plot_put_quoted(f, text);
    fprintf(f, " at screen %.5f,%.5f center noenhanced font \",%d\" tc rgb "
            "\"%s\" front\n", cx / WIDE, cy / HIGH, 10,
            m->row->pareto || m->none ? "#202020" : "#808080");
}

enum kind { BEHIND, FRONT, NONE };  /* the Pareto front */

/* ---- the script --------------------------------------------------------- */

/* Order of qsort: fastest first. */
static int plot_by_time(const void *a, const void *b)
{
    const struct mark *p = a, *q = b;

    return p->x < q->x ? -1 : p->x > q->x;
}

/* What a row's mark looks like. */
static enum kind plot_kind(const struct mark *m)
{
    return m->none ? NONE : m->row->pareto ? FRONT : BEHIND;
}

/* The points of one kind. */
static void plot_put_points(FILE *f, const struct panel *p, int group,
                            int kind, const char *name)
{
    fprintf(f, "$%s%d << END\n", name, group);
    for (size_t i = 0; i < p->marks; i++) {
        const struct mark *m = &p->mark[i];

        if (m->group == group && (int)plot_kind(m) == kind)
            fprintf(f, "%.6g %.6g\n", pow(10, m->x), pow(10, m->y));
    }
    fputs("END\n", f);
}

/* Whether a panel has a point of a kind. */
static bool plot_has_kind(const struct panel *p, int group, int kind)
{
    for (size_t i = 0; i < p->marks; i++)
        if (p->mark[i].group == group && (int)plot_kind(&p->mark[i]) == kind)
            return true;
    return false;
}

/* Under two decades gnuplot labels too few tics: 1, 2 and 5 of each. */
static void plot_put_tics(FILE *f, char axis, double lo, double hi)
{
    static const int step[3] = {1, 2, 5};
    const char *mark = "";

    fprintf(f, "set %ctics ", axis);
    if (hi - lo > 2) {
        fputs("autofreq\n", f);
        return;
    }
    fputc('(', f);
    for (int decade = (int)floor(lo); decade <= (int)ceil(hi); decade++)
        for (int k = 0; k < 3; k++, mark = ", ")
            fprintf(f, axis == 'x' ? "%s\"%g\" %.6g" : "%s\"%.0e\" %.6g", mark,
                    step[k] * pow(10, decade), step[k] * pow(10, decade));
    fputs(")\n", f);
}

/* Ranges, names and grid. */
static void plot_put_axes(FILE *f, const struct panel *p)
{
    fprintf(f, "unset label\nunset arrow\n"
            "set lmargin at screen %.5f\nset rmargin at screen %.5f\n"
            "set bmargin at screen %.5f\nset tmargin at screen %.5f\n",
            p->frame.x0 / WIDE, p->frame.x1 / WIDE, p->frame.y0 / HIGH,
            p->frame.y1 / HIGH);
    fprintf(f, "set xrange [%.6g:%.6g]\nset yrange [%.6g:%.6g]\n",
            pow(10, p->x0), pow(10, p->x1), pow(10, p->y0), pow(10, p->y1));
    plot_put_tics(f, 'x', p->x0, p->x1);
    plot_put_tics(f, 'y', p->y0, p->y1);
    fprintf(f, "set y2range [%.6g:%.6g]\nset title \"%s\" font \",13\"\n",
            -20 * p->y0, -20 * p->y1, p->title);
    fprintf(f, "set key at screen %.5f,%.5f left top vertical maxcols 1 Left "
            "reverse\n", p->frame.x0 / WIDE, (p->frame.y0 - 62) / HIGH);
}

/* gnuplot's command: points filled on the Pareto front, hollow off it, a line
 * along the front, a diamond for the reference; a title for each group. */
static void plot_put_curves(FILE *f, const struct panel *p, const char *name)
{
    static const char *const color[] = {"#0072b2", "#d55e00", "#009e73",
                                        "#cc79a7", "#7a5c00", "#56b4e9",
                                        "#8a2be2", "#e69f00"};
    static const int point[3] = {6, 7, 12};
    static const enum kind order[3] = {FRONT, BEHIND, NONE};
    const char *mark = "plot";

    for (int g = 0; g < p->groups; g++) {
        const struct bench_row *r = p->group[g];
        bool titled = false;

        for (int i = 0; i < 3; i++) {
            const int kind = (int)order[i];

            if (!plot_has_kind(p, g, kind))
                continue;
            fprintf(f, "%s $%s%c%d using 1:2 with %s pt %d ps 1.3 lw 1.6 "
                    "lc rgb \"%s\" ", mark, name, "oxr"[kind], g,
                    kind == FRONT ? "linespoints" : "points", point[kind],
                    color[g % 8]);
            if (titled)
                fputs("notitle", f);
            else
                fprintf(f, "title \"%s %s, %d thread%s\"", r->stage,
                        r->config, r->threads, r->threads > 1 ? "s" : "");
            mark = ", \\\n    ";
            titled = true;
        }
    }
    fputc('\n', f);
}

/* A panel: axes, labels, the points as data blocks, then what draws them. */
static void plot_put_panel(FILE *f, struct panel *p, const char *name)
{
    char full[40];

    plot_put_axes(f, p);
    for (int front = 1; front >= 0; front--)    /* the front chooses first */
        for (size_t i = 0; i < p->marks; i++)
            if (p->mark[i].row->pareto == front)
                plot_put_label(f, p, &p->mark[i]);
    qsort(p->mark, p->marks, sizeof *p->mark, plot_by_time);
    for (int g = 0; g < p->groups; g++)
        for (int kind = 0; kind < 3; kind++) {
            snprintf(full, sizeof full, "%s%c", name, "oxr"[kind]);
            if (plot_has_kind(p, g, kind))
                plot_put_points(f, p, g, kind, full);
        }
    plot_put_curves(f, p, name);
}

/* gnuplot's terminal for the name's ending. */
static const char *plot_terminal(const char *file)
{
    const char *dot = strrchr(file, '.');

    if (dot && !strcmp(dot, ".svg"))
        return "svg size 1800,1200 background \"white\" font \"Sans,11\"";
    if (dot && !strcmp(dot, ".pdf"))
        return "pdfcairo size 18,12 font \"Sans,11\" fontscale 1.35";
    return "pngcairo size 1800,1200 font \"Sans,11\"";
}

/* Where panel i of n lies: the first on top, up to three below it. */
static struct box plot_place_panel(size_t i, size_t n)
{
    const size_t below = n - 1;
    const double right = WIDE - 90;

    if (i == 0)
        return (struct box){100, below ? 610 : 190, right, HIGH - 90};
    double wide = (right - 100) / (double)below;
    return (struct box){100 + wide * (double)(i - 1) + (i > 1 ? 65 : 0), 170,
                        100 + wide * (double)i - (i < below ? 65 : 0), 450};
}

/* The whole script. */
static char *plot_write_script(struct panel *p, size_t n, const char *file,
                               const struct bench *b, struct error *err)
{
    char *text = NULL, name[2] = "a";
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    if (!f) {
        error_set(err, EX_OSERR, "out of memory");
        return NULL;
    }
    fprintf(f, "set terminal %s\nset output ", plot_terminal(file));
    plot_put_quoted(f, file);
    fprintf(f, "\nset termoption noenhanced\nset multiplot title \"What a "
            "millisecond costs in accuracy.  Filled and joined: the Pareto "
            "front.  %s, %s, %d thread%s\" font \",14\"\n", cpu_name(),
            cpu_level_name(cpu_level()), b->threads,
            b->threads > 1 ? "s" : "");
    fputs("set logscale xy 10\nset format y \"%.0e\"\nset ytics nomirror\n"
          "set y2tics\nset grid lc rgb \"#dddddd\" lw 0.8\n"
          "set key font \",10\"\n"
          "set xlabel \"milliseconds a call (least)\" offset 0,0.4\n"
          "set label\nset ylabel \"RMS error\" offset 1,0\n"
          "set y2label \"PSNR, dB\" offset -1,0\n", f);
    for (size_t i = 0; i < n; i++, name[0]++) {
        plot_lay_out(&p[i], plot_place_panel(i, n));
        plot_put_panel(f, &p[i], name);
    }
    fputs("unset multiplot\n", f);
    if (fclose(f)) {
        free(text);
        error_set(err, EX_OSERR, "out of memory");
        return NULL;
    }
    return text;
}

char *bench_plot(const struct bench *b, const char *file, struct error *err)
{
    struct panel *p = calloc(34, sizeof *p);
    char *text = NULL;
    size_t n;

    if (!p) {
        error_set(err, EX_OSERR, "out of memory");
        return NULL;
    }
    n = plot_choose(p, b);
    if (n == 0)
        error_set(err, EX_DATAERR, "%s: no two rows have an error to draw "
                  "(expected a stage such as splat, motion or refine)", file);
    else
        text = plot_write_script(p, n, file, b, err);
    free(p);
    return text;
}
