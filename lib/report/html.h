/* Pieces of one self-contained HTML page: pictures as data URIs, charts as
 * inline SVG, tables.  Nothing is fetched when the page is opened. */
#ifndef SPID_REPORT_HTML_H
#define SPID_REPORT_HTML_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "lib/base/error.h"

void html_begin(FILE *f, const char *title);
void html_end(FILE *f);

/* Text with <, >, & and quotes escaped. */
void html_text(FILE *f, const char *text);
/* <h2>title</h2> and, unless NULL, a paragraph under it. */
void html_section(FILE *f, const char *title, const char *lead);

/* A row of pictures with captions: html_row, html_picture..., html_row_end. */
void html_row(FILE *f);
void html_row_end(FILE *f);
/* rgb [height,width,3] as a PNG inside the page. */
int html_picture(FILE *f, const uint8_t *rgb, size_t width, size_t height,
                 const char *caption, struct error *err);

/* One curve of a chart; values that are not finite leave a gap. */
struct html_curve {
    const char *name;
    const double *y;          /* (n) */
};

/* Curves over x (n, increasing), drawn to one scale, with a legend. */
void html_chart(FILE *f, const char *title, const char *x_label,
                const double *x, size_t n, const struct html_curve *curves,
                size_t count);

/* Horizontal bars with their values printed, all of one unit. */
void html_bars(FILE *f, const char *title, const char *unit,
               const char *const *name, const double *value, size_t n);

/* Flat table of name and value. */
void html_table_begin(FILE *f, const char *const *heads, size_t n);
void html_table_row(FILE *f, const char *const *cells, size_t n);
void html_table_end(FILE *f);

#endif
