/* The pieces of a page that needs nothing else: pictures as data URLs, curves
 * that its script draws, tables. */
#include "lib/lab/report/html.h"

#include <math.h>
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

void html_begin(FILE *f)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
          "<meta name=\"viewport\" content=\"width=device-width, "
          "initial-scale=1\">"
          "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src "
          "'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
          "img-src data:; media-src data: blob:\"><title>SpiD run</title>", f);
    fprintf(f, "<style>%s</style></head><body>\n<h1>SpiD run</h1>\n", style);
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

/* "name":[numbers], null where one is not finite. */
static void html_numbers(FILE *f, const char *name, const double *v, size_t n)
{
    fprintf(f, "\"%s\":[", name);
    for (size_t i = 0; i < n; i++) {
        fputs(i ? "," : "", f);
        fprintf(f, isfinite(v[i]) ? "%.5g" : "null", v[i]);
    }
    fputc(']', f);
}

void html_chart(FILE *f, const char *title, const double *x, size_t n,
                const struct html_curve *curves, size_t count)
{
    fputs("<h3>", f);
    html_text(f, title);
    fputs("</h3>\n<svg class=\"chart\" role=\"img\" aria-label=\"", f);
    html_text(f, title);
    fputs("\"></svg><script type=\"application/json\">{", f);
    html_numbers(f, "x", x, n);
    fputs(",\"curves\":{", f);
    for (size_t k = 0; k < count; k++) {
        fputs(k ? "," : "", f);
        html_numbers(f, curves[k].name, curves[k].y, n);
    }
    fputs("}}</script>\n", f);
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
