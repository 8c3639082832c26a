/* The pieces of a page that needs nothing else: pictures as data URLs, curves
 * as SVG, tables. */
#include "lib/report/html.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sysexits.h>

#include "formats/png.h"

static const char style[] =
    "body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;"
    "padding:0 1rem;color:#1c1c1e;background:#fff}"
    "h1{font-size:1.7rem}h2{font-size:1.2rem;margin-top:2.2rem;"
    "border-bottom:1px solid #ddd}"
    ".row{display:flex;flex-wrap:wrap;gap:.6rem}"
    "figure{margin:0}figure img{display:block;width:10.8rem;height:auto;"
    "background:#000;border-radius:4px}"
    "figcaption{font-size:.8rem;color:#555;text-align:center}"
    "table{border-collapse:collapse}td,th{padding:.15rem .8rem;"
    "border-bottom:1px solid #eee;text-align:left}"
    "td+td{text-align:right;font-variant-numeric:tabular-nums}"
    "svg{width:100%;max-width:60rem;height:auto}svg text{font:12px sans-serif}";

static const char *const palette[] = {"#0b6bcb", "#d1495b", "#2a9d4a",
                                      "#b8860b", "#7a4fbf", "#008080"};
#define COLORS (sizeof palette / sizeof *palette)

void html_begin(FILE *f, const char *title)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
          "<meta name=\"viewport\" content=\"width=device-width\"><title>",
          f);
    html_text(f, title);
    fprintf(f, "</title><style>%s</style></head><body>\n<h1>", style);
    html_text(f, title);
    fputs("</h1>\n", f);
}

void html_end(FILE *f)
{
    fputs("</body></html>\n", f);
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

/* n bytes as RFC 4648 says, without line breaks. */
static void html_base64(FILE *f, const uint8_t *p, size_t n)
{
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                "abcdefghijklmnopqrstuvwxyz0123456789+/";

    for (size_t i = 0; i < n; i += 3) {
        size_t left = n - i;
        unsigned v = (unsigned)p[i] << 16 |
                     (left > 1 ? (unsigned)p[i + 1] << 8 : 0) |
                     (left > 2 ? p[i + 2] : 0);

        fputc(digit[v >> 18], f);
        fputc(digit[v >> 12 & 63], f);
        fputc(left > 1 ? digit[v >> 6 & 63] : '=', f);
        fputc(left > 2 ? digit[v & 63] : '=', f);
    }
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
        fputs("<figure><img alt=\"\" src=\"data:image/png;base64,", f);
        html_base64(f, (const uint8_t *)bytes, n);
        fputs("\"><figcaption>", f);
        html_text(f, caption);
        fputs("</figcaption></figure>\n", f);
    }
    free(bytes);
    return rc;
}

/* ---- charts ------------------------------------------------------------- */

enum { WIDE = 900, HIGH = 220, LEFT = 60, RIGHT = 20, TOP = 26, FOOT = 40 };

struct axis {
    double lo, hi;
    int from, to;             /* SVG coordinates of lo and hi */
};

/* Where the value v lies, in pixels. */
static double axis_place(const struct axis *a, double v)
{
    double span = a->hi > a->lo ? a->hi - a->lo : 1;

    return a->from + (v - a->lo) / span * (a->to - a->from);
}

/* Vertical, spanning all finite values of the curves. */
static struct axis value_axis(const struct html_curve *c, size_t count,
                              size_t n)
{
    struct axis a = {INFINITY, -INFINITY, HIGH - FOOT, TOP};

    for (size_t k = 0; k < count; k++)
        for (size_t i = 0; i < n; i++)
            if (isfinite(c[k].y[i])) {
                a.lo = fmin(a.lo, c[k].y[i]);
                a.hi = fmax(a.hi, c[k].y[i]);
            }
    if (!(a.hi >= a.lo))
        a.lo = a.hi = 0;
    return a;
}

/* Grid lines with their values, and the ends of the horizontal axis. */
static void draw_axes(FILE *f, const struct axis *x, const struct axis *y,
                      const char *x_label)
{
    for (int k = 0; k <= 4; k++) {
        double v = y->lo + (y->hi - y->lo) * k / 4, at = axis_place(y, v);

        fprintf(f, "<line x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\" "
                "stroke=\"#ddd\"/><text x=\"%d\" y=\"%.1f\" "
                "text-anchor=\"end\">%.3g</text>", LEFT, WIDE - RIGHT, at, at,
                LEFT - 6, at + 4, v);
    }
    fprintf(f, "<text x=\"%d\" y=\"%d\">%.3g</text><text x=\"%d\" y=\"%d\" "
            "text-anchor=\"end\">%.3g %s</text>", LEFT, HIGH - 18, x->lo,
            WIDE - RIGHT, HIGH - 18, x->hi, x_label);
}

/* A path that lifts its pen over values that are not finite. */
static void draw_curve(FILE *f, const struct axis *x, const struct axis *y,
                       const double *xs, const struct html_curve *c, size_t n,
                       size_t index)
{
    const char *color = palette[index % COLORS];
    bool pen = false;

    fputs("<path fill=\"none\" stroke-width=\"1.6\" d=\"", f);
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(c->y[i])) {
            pen = false;
            continue;
        }
        fprintf(f, "%c%.1f %.1f", pen ? 'L' : 'M', axis_place(x, xs[i]),
                axis_place(y, c->y[i]));
        pen = true;
    }
    fprintf(f, "\" stroke=\"%s\"/><text x=\"%zu\" y=\"16\" fill=\"%s\">",
            color, LEFT + 120 * index, color);
    html_text(f, c->name);
    fputs("</text>", f);
}

void html_chart(FILE *f, const char *title, const char *x_label,
                const double *x, size_t n, const struct html_curve *curves,
                size_t count)
{
    struct axis ax = {n ? x[0] : 0, n ? x[n - 1] : 1, LEFT, WIDE - RIGHT};
    struct axis ay = value_axis(curves, count, n);

    fputs("<h3>", f);
    html_text(f, title);
    fprintf(f, "</h3>\n<svg viewBox=\"0 0 %d %d\" role=\"img\">", WIDE, HIGH);
    draw_axes(f, &ax, &ay, x_label);
    for (size_t k = 0; k < count; k++)
        draw_curve(f, &ax, &ay, x, &curves[k], n, k);
    fputs("</svg>\n", f);
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
                "%.3g %s</text>", 24 * i + 5, w, palette[0], 188 + w,
                24 * i + 18, value[i], unit);
    }
    fputs("</svg>\n", f);
}

/* ---- tables ------------------------------------------------------------- */

/* Cells as <td> or <th>, escaped. */
static void table_row(FILE *f, const char *tag, const char *const *cells,
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
    table_row(f, "th", heads, n);
}

void html_table_row(FILE *f, const char *const *cells, size_t n)
{
    table_row(f, "td", cells, n);
}

void html_table_end(FILE *f)
{
    fputs("</table>\n", f);
}
