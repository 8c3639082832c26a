/* A table of figures: rows are methods, columns metrics; means over what
 * could be measured, failures counted apart. */
#ifndef SPID_LAB_EVAL_TABLE_H
#define SPID_LAB_EVAL_TABLE_H

#include <cjson/cJSON.h>
#include <stddef.h>
#include <stdio.h>


#define TABLE_COLUMNS 32
#define TABLE_NAME 64
#define TABLE_NO_ROW ((size_t)-1)

struct table_cell {
    double sum;
    size_t count;           /* measured */
    size_t failed;          /* could not be measured */
};

struct table_row {
    char name[TABLE_NAME];
    struct table_cell cell[TABLE_COLUMNS];
};

struct table {
    size_t columns, rows, room;
    char column[TABLE_COLUMNS][TABLE_NAME]; /* "psnr" */
    int better[TABLE_COLUMNS];              /* 1 higher, -1 lower, 0 neither */
    struct table_row *row;
};

enum table_format { TABLE_TEXT, TABLE_TSV, TABLE_JSON, TABLE_LATEX };

/* No rows and no columns yet; it cannot fail. */
void table_init(struct table *t);
/* Free what it holds; zeroed then. */
void table_release(struct table *t);

/* Index of the column or row of that name, made when new.  A row index of
 * TABLE_NO_ROW: memory is short; a column of that index: there are too many. */
size_t table_column(struct table *t, const char *name, int better);
/* The same for a row. */
size_t table_row(struct table *t, const char *name);

/* Add a value; one that is not finite counts as failed. */
void table_add(struct table *t, size_t row, size_t column, double value);
/* Mean of a cell; NaN when nothing was measured. */
double table_mean(const struct table *t, size_t row, size_t column);

/* "text", "tsv", "json", "latex"; -1 for any other word. */
int table_format_parse(enum table_format *f, const char *word);

/* {"ROW":{"COLUMN":mean,...,"frames":n,"failed":n},...} with null where nothing
 * was measured, for the caller to delete. */
cJSON *table_json(const struct table *t);
/* Write it as text, and delete it. */
void table_put_json(FILE *f, cJSON *json);
/* Write the table, as table_json has it, or LaTeX: a tabular, best values
 * bold. */
void table_write(FILE *f, const struct table *t, enum table_format format);

#endif
