/* Pieces of one self-contained HTML page: pictures as data URIs, charts that
 * its script draws, tables.  Nothing is fetched when the page is opened. */
#ifndef SPID_LAB_REPORT_HTML_H
#define SPID_LAB_REPORT_HTML_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "lib/base/error.h"

/* Head of a run's page, its style and script inside. */
void html_begin(FILE *f);
/* What html_begin left open. */
void html_end(FILE *f);

/* Text with <, >, & and quotes escaped. */
void html_text(FILE *f, const char *text);
/* <h2>title</h2> and, unless NULL, a paragraph under it. */
void html_section(FILE *f, const char *title, const char *lead);

/* A row of pictures with captions: html_row, html_picture..., html_row_end. */
void html_row(FILE *f);
/* The end of the row. */
void html_row_end(FILE *f);
/* rgb [height,width,3] as a PNG inside the page. */
int html_picture(FILE *f, const uint8_t *rgb, size_t width, size_t height,
                 const char *caption, struct error *err);

/* One curve of a chart; values that are not finite leave a gap.  page.js knows
 * the names, and draws what it does not know as the first. */
struct html_curve {
    const char *name;
    const double *y;          /* (n) */
};

/* Driver and result, halves of one video (mp4, n bytes), one over the other
 * with a wipe between them.  The page's charts follow its time. */
void html_wipe(FILE *f, const uint8_t *mp4, size_t n, size_t size,
               double rate);

/* Curves over x (n seconds, increasing), drawn to one scale, with a legend. */
void html_chart(FILE *f, const char *title, const double *x, size_t n,
                const struct html_curve *curves, size_t count);

/* Flat table of name and value. */
void html_table_begin(FILE *f, const char *const *heads, size_t n);
/* A row of n cells, escaped. */
void html_table_row(FILE *f, const char *const *cells, size_t n);
/* The end of the table. */
void html_table_end(FILE *f);

#endif
