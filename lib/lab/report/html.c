/* The pieces of a page that needs nothing else: pictures as data URLs, curves
 * as SVG, tables. */
#include "lib/lab/report/html.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sysexits.h>

#include "formats/base64.h"
#include "formats/png.h"

/* The page's own style and script (page.css, page.js), as the Makefile turns
 * them into strings. */
static const char style[] =
#include "report_page.css.inc"
    ;
static const char script[] =
#include "report_page.js.inc"
    ;

static const struct {
    const char *color, *dash;
} looks[] = {[HTML_FIRST] = {"#0072b2", "none"},
             [HTML_SECOND] = {"#d55e00", "7 2"},
             [HTML_THIRD] = {"#008060", "2 3"},
             [HTML_NULL] = {"#6b6b6b", "1 4"}};

void html_begin(FILE *f, const char *title)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
          "<meta name=\"viewport\" content=\"width=device-width, "
          "initial-scale=1\">"
          "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src "
          "'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
          "img-src data:; media-src data: blob:\"><title>", f);
    html_text(f, title);
    fprintf(f, "</title><style>%s</style></head><body>\n<h1>", style);
    html_text(f, title);
    fputs("</h1>\n", f);
}

void html_end(FILE *f)
{
    fprintf(f, "<script>%s</script>\n</body></html>\n", script);
}

void html_text(FILE *f, const char *text)
{
    for (; *text; text++)
        switch (*text) {
        case '<': fputs("&lt;", f); break;
        case '>': fputs("&gt;", f); break;
        case '&': fputs("&amp;", f); break;
        case '"': fputs("&quot;", f); break;
        default: fputc(*text, f);
        }
}

void html_section(FILE *f, const char *title, const char *lead)
{
    fputs("<h2>", f);
    html_text(f, title);
    fputs("</h2>\n", f);
    if (lead) {
        fputs("<p>", f);
        html_text(f, lead);
        fputs("</p>\n", f);
    }
}

void html_row(FILE *f)
{
    fputs("<div class=\"row\">\n", f);
}

void html_row_end(FILE *f)
{
    fputs("</div>\n", f);
}

int html_picture(FILE *f, const uint8_t *rgb, size_t width, size_t height,
                 const char *caption, struct error *err)
{
    char *bytes = NULL;
    size_t n = 0;
    FILE *memory = open_memstream(&bytes, &n);
    int rc = -1;

    if (!memory)
        return error_set(err, EX_OSERR, "out of memory for a picture");
    rc = png_write(memory, rgb, width, height, 3, err);
    if (fclose(memory) && !rc)
        rc = error_set(err, EX_OSERR, "out of memory for a picture");
    if (!rc) {
        fputs("<figure><img alt=\"", f);
        html_text(f, caption);
        fputs("\" src=\"data:image/png;base64,", f);
        base64_write(f, (const uint8_t *)bytes, n);
        fputs("\"><figcaption>", f);
        html_text(f, caption);
        fputs("</figcaption></figure>\n", f);
    }
    free(bytes);
    return rc;
}

void html_wipe(FILE *f, const uint8_t *mp4, size_t n, size_t size,
               double rate)
{
    fprintf(f, "<div id=\"wipe\" data-rate=\"%.6g\">\n"
            "<div class=\"screen\"><video muted loop playsinline "
            "preload=\"auto\" aria-label=\"Driver and result side by "
            "side\" src=\"data:video/mp4;base64,", rate);
    base64_write(f, mp4, n);
    fprintf(f, "\"></video>\n<canvas width=\"%zu\" height=\"%zu\" "
            "role=\"img\" aria-label=\"Driver left of the line, result "
            "right of it\"></canvas><b class=\"left\">Driver</b>"
            "<b class=\"right\">Result</b><i></i></div>\n"
            "<label>Wipe <input type=\"range\" id=\"line\" min=\"0\" "
            "max=\"100\" value=\"50\"></label>\n"
            "<div class=\"bar\"><button id=\"play\">Play</button>"
            "<label>Time <input type=\"range\" id=\"time\" min=\"0\" "
            "max=\"1\" step=\"any\" value=\"0\"></label>"
            "<output id=\"clock\">0.00 s</output></div>\n"
            "<p id=\"unplayed\" hidden>This browser does not play the video: "
            "the frames below show the same.</p>\n</div>\n", size, size);
}

/* ---- charts ------------------------------------------------------------- */

enum { WIDE = 560, HIGH = 200, LEFT = 52, RIGHT = 16, TOP = 30, FOOT = 34 };

struct axis {
    double lo, hi;
    int from, to;             /* SVG coordinates of lo and hi */
    double step;              /* between grid lines */
};

/* Where the value v lies, in pixels. */
static double html_axis_place(const struct axis *a, double v)
{
    double span = a->hi > a->lo ? a->hi - a->lo : 1;

    return a->from + (v - a->lo) / span * (a->to - a->from);
}

/* A round number (1, 2 or 5 times a power of ten) near span / 4. */
static double html_axis_step(double span)
{
    double step = pow(10, floor(log10(span / 4))), rest = span / 4 / step;

    return step * (rest < 1.5 ? 1 : rest < 3.5 ? 2 : rest < 7.5 ? 5 : 10);
}

/* Vertical, spanning all finite values of the curves between round ends. */
static struct axis html_value_axis(const struct html_curve *c, size_t count,
                                   size_t n)
{
    struct axis a = {INFINITY, -INFINITY, HIGH - FOOT, TOP, 1};

    for (size_t k = 0; k < count; k++)
        for (size_t i = 0; i < n; i++)
            if (isfinite(c[k].y[i])) {
                a.lo = fmin(a.lo, c[k].y[i]);
                a.hi = fmax(a.hi, c[k].y[i]);
            }
    if (!(a.hi >= a.lo))
        a.lo = a.hi = 0;
    if (!(a.hi - a.lo > 1e-6 * fmax(fabs(a.lo), 1e-3)))
        a.hi = a.lo + fmax(fabs(a.lo), 1e-3);
    a.step = html_axis_step(a.hi - a.lo);
    a.lo = floor(a.lo / a.step + 1e-9) * a.step;
    a.hi = ceil(a.hi / a.step - 1e-9) * a.step;
    return a;
}

/* Grid lines with their values, and the ends of the horizontal axis. */
static void html_draw_axes(FILE *f, const struct axis *x, const struct axis *y,
                           const char *x_label)
{
    int lines = (int)lround((y->hi - y->lo) / y->step);

    for (int k = 0; k <= lines; k++) {
        double v = (round(y->lo / y->step) + k) * y->step;
        double at = html_axis_place(y, v);

        fprintf(f, "<line x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\" "
                "stroke=\"#ddd\"/><text x=\"%d\" y=\"%.1f\" "
                "text-anchor=\"end\">%.3g</text>", LEFT, WIDE - RIGHT, at, at,
                LEFT - 6, at + 4, v);
    }
    fprintf(f, "<text x=\"%d\" y=\"%d\">%.3g</text><text x=\"%d\" y=\"%d\" "
            "text-anchor=\"end\">%.3g %s</text>", LEFT, HIGH - 14, x->lo,
            WIDE - RIGHT, HIGH - 14, x->hi, x_label);
}

/* A path that lifts its pen over values that are not finite. */
static void html_draw_curve(FILE *f, const struct axis *x, const struct axis *y,
                            const double *xs, const struct html_curve *c,
                            size_t n, size_t index)
{
    const char *color = looks[c->look].color, *dash = looks[c->look].dash;
    bool pen = false;

    fputs("<path fill=\"none\" stroke-width=\"2\" d=\"", f);
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(c->y[i])) {
            pen = false;
            continue;
        }
        fprintf(f, "%c%.1f %.1f", pen ? 'L' : 'M', html_axis_place(x, xs[i]),
                html_axis_place(y, c->y[i]));
        pen = true;
    }
    fprintf(f, "\" stroke=\"%s\" stroke-dasharray=\"%s\"/>"
            "<path stroke-width=\"3\" d=\"M%zu 12h26\" stroke=\"%s\" "
            "stroke-dasharray=\"%s\"/><text x=\"%zu\" y=\"16\">",
            color, dash, LEFT + 116 * index, color, dash,
            LEFT + 32 + 116 * index);
    html_text(f, c->name);
    fputs("</text>", f);
}

void html_chart(FILE *f, const char *title, const char *x_label,
                const double *x, size_t n, const struct html_curve *curves,
                size_t count)
{
    struct axis ax = {n ? x[0] : 0, n ? x[n - 1] : 1, LEFT, WIDE - RIGHT,
                      1};
    struct axis ay = html_value_axis(curves, count, n);

    fputs("<h3>", f);
    html_text(f, title);
    fprintf(f, "</h3>\n<svg class=\"chart\" viewBox=\"0 0 %d %d\" "
            "role=\"img\" aria-label=\"", WIDE, HIGH);
    html_text(f, title);
    fprintf(f, "\" data-from=\"%.9g\" data-to=\"%.9g\" data-left=\"%d\" "
            "data-right=\"%d\">", ax.lo, ax.hi, ax.from, ax.to);
    html_draw_axes(f, &ax, &ay, x_label);
    for (size_t k = 0; k < count; k++)
        html_draw_curve(f, &ax, &ay, x, &curves[k], n, k);
    fprintf(f, "<line class=\"now\" x1=\"%d\" x2=\"%d\" y1=\"%d\" "
            "y2=\"%d\"/></svg>\n", LEFT, LEFT, TOP, HIGH - FOOT);
}

void html_bars(FILE *f, const char *title, const char *unit,
               const char *const *name, const double *value, size_t n)
{
    double top = 0;

    for (size_t i = 0; i < n; i++)
        top = fmax(top, value[i]);
    fputs("<h3>", f);
    html_text(f, title);
    fprintf(f, "</h3>\n<svg viewBox=\"0 0 %d %zu\" role=\"img\">", WIDE,
            24 * n + 8);
    for (size_t i = 0; i < n; i++) {
        double w = top > 0 ? value[i] / top * (WIDE - 330) : 0;

        fprintf(f, "<text x=\"170\" y=\"%zu\" text-anchor=\"end\">",
                24 * i + 18);
        html_text(f, name[i]);
        fprintf(f, "</text><rect x=\"180\" y=\"%zu\" width=\"%.1f\" "
                "height=\"16\" fill=\"%s\"/><text x=\"%.1f\" y=\"%zu\">"
                "%.3g %s</text>", 24 * i + 5, w, looks[HTML_FIRST].color,
                188 + w, 24 * i + 18, value[i], unit);
    }
    fputs("</svg>\n", f);
}

/* ---- tables ------------------------------------------------------------- */

/* Cells as <td> or <th>, escaped. */
static void html_cells(FILE *f, const char *tag, const char *const *cells,
                       size_t n)
{
    fputs("<tr>", f);
    for (size_t i = 0; i < n; i++) {
        fprintf(f, "<%s>", tag);
        html_text(f, cells[i]);
        fprintf(f, "</%s>", tag);
    }
    fputs("</tr>\n", f);
}

void html_table_begin(FILE *f, const char *const *heads, size_t n)
{
    fputs("<table>\n", f);
    html_cells(f, "th", heads, n);
}

void html_table_row(FILE *f, const char *const *cells, size_t n)
{
    html_cells(f, "td", cells, n);
}

void html_table_end(FILE *f)
{
    fputs("</table>\n", f);
}
