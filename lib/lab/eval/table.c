/* Sums and counts of every cell, and four ways to print their means. */
#include "lib/lab/eval/table.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/list.h"

void table_init(struct table *t)
{
    memset(t, 0, sizeof *t);
}

void table_release(struct table *t)
{
    free(t->row);
    memset(t, 0, sizeof *t);
}

size_t table_column(struct table *t, const char *name, int better)
{
    for (size_t i = 0; i < t->columns; i++)
        if (!strcmp(t->column[i], name))
            return i;
    if (t->columns == TABLE_COLUMNS)
        return (size_t)-1;
    snprintf(t->column[t->columns], TABLE_NAME, "%s", name);
    t->better[t->columns] = better;
    return t->columns++;
}

size_t table_row(struct table *t, const char *name)
{
    char cut[TABLE_NAME];

    snprintf(cut, sizeof cut, "%s", name);
    for (size_t i = 0; i < t->rows; i++)
        if (!strcmp(t->row[i].name, cut))
            return i;
    struct table_row *row = list_add(&t->row, &t->rows, &t->room, sizeof *row,
                                     NULL);
    if (!row)
        return (size_t)-1;
    memcpy(row->name, cut, sizeof cut);
    return t->rows - 1;
}

void table_add(struct table *t, size_t row, size_t column, double value)
{
    struct table_cell *c;

    if (row >= t->rows || column >= t->columns)
        return;
    c = &t->row[row].cell[column];
    if (!isfinite(value)) {
        c->failed++;
    } else {
        c->sum += value;
        c->count++;
    }
}

double table_mean(const struct table *t, size_t row, size_t column)
{
    const struct table_cell *c;

    if (row >= t->rows || column >= t->columns)
        return NAN;
    c = &t->row[row].cell[column];
    return c->count ? c->sum / (double)c->count : NAN;
}

int table_format_parse(enum table_format *f, const char *word)
{
    static const char *const words[] = {"text", "tsv", "json", "latex"};

    for (int i = 0; i < 4; i++)
        if (!strcmp(word, words[i])) {
            *f = (enum table_format)i;
            return 0;
        }
    return -1;
}

/* Most measured in any cell of a row: its frames; or most failures: frames
 * that could not be judged. */
static size_t table_row_max(const struct table *t, size_t row, bool failed)
{
    size_t max = 0;

    for (size_t c = 0; c < t->columns; c++) {
        const struct table_cell *cell = &t->row[row].cell[c];
        size_t n = failed ? cell->failed : cell->count;

        max = n > max ? n : max;
    }
    return max;
}

/* A number as LaTeX shows it. */
static void table_number(FILE *f, double x)
{
    if (isnan(x))
        fputs("--", f);
    else
        fprintf(f, fabs(x) >= 10 ? "%.2f" : fabs(x) >= 0.1 ? "%.3f" : "%.4f",
                x);
}

/* Columns for people, or tab-separated. */
static void table_write_text(FILE *f, const struct table *t, bool tsv)
{
    int wide = 18;

    for (size_t r = 0; r < t->rows && !tsv; r++)
        wide = (int)strlen(t->row[r].name) > wide ? (int)strlen(t->row[r].name)
                                                  : wide;
    fprintf(f, "%-*s", tsv ? 0 : wide, "method");
    for (size_t c = 0; c < t->columns; c++)
        fprintf(f, tsv ? "\t%s" : " %11s", t->column[c]);
    fprintf(f, tsv ? "\tframes\tfailed\n" : "  frames  failed\n");
    for (size_t r = 0; r < t->rows; r++) {
        fprintf(f, "%-*s", tsv ? 0 : wide, t->row[r].name);
        for (size_t c = 0; c < t->columns; c++) {
            double x = table_mean(t, r, c);
            char cell[40] = "-";
            if (!isnan(x))
                snprintf(cell, sizeof cell, tsv ? "%.9g"
                         : fabs(x) >= 10        ? "%.2f"
                         : fabs(x) >= 0.1       ? "%.3f"
                                                : "%.4f", x);
            fprintf(f, tsv ? "\t%s" : " %11s", cell);
        }
        fprintf(f, tsv ? "\t%zu\t%zu\n" : " %7zu %7zu\n",
                table_row_max(t, r, false), table_row_max(t, r, true));
    }
}

cJSON *table_json(const struct table *t)
{
    cJSON *rows = cJSON_CreateObject();

    for (size_t r = 0; r < t->rows; r++) {
        cJSON *o = cJSON_AddObjectToObject(rows, t->row[r].name);

        for (size_t c = 0; c < t->columns; c++)     /* null where it is NaN */
            cJSON_AddNumberToObject(o, t->column[c], table_mean(t, r, c));
        cJSON_AddNumberToObject(o, "frames", (double)table_row_max(t, r, false));
        cJSON_AddNumberToObject(o, "failed", (double)table_row_max(t, r, true));
    }
    return rows;
}

void table_put_json(FILE *f, cJSON *json)
{
    char *text = cJSON_Print(json);

    cJSON_Delete(json);
    fprintf(f, "%s\n", text ? text : "");
    free(text);
}

/* A string with what LaTeX wants escaped. */
static void table_latex_string(FILE *f, const char *s)
{
    for (; *s; s++) {
        if (strchr("_&%#$", *s))
            fputc('\\', f);
        fputc(*s, f);
    }
}

/* Whether no row has a better mean in this column. */
static bool table_is_best(const struct table *t, size_t row, size_t col)
{
    double x = table_mean(t, row, col);

    if (isnan(x) || !t->better[col])
        return false;
    for (size_t r = 0; r < t->rows; r++)
        if (table_mean(t, r, col) * t->better[col] > x * t->better[col])
            return false;
    return true;
}

/* A tabular, best values bold. */
static void table_write_latex(FILE *f, const struct table *t)
{
    fputs("\\begin{tabular}{l", f);
    for (size_t c = 0; c < t->columns; c++)
        fputc('c', f);
    fputs("}\n\\toprule\nMethod", f);
    for (size_t c = 0; c < t->columns; c++) {
        fputs(" & ", f);
        table_latex_string(f, t->column[c]);
        if (t->better[c])
            fputs(t->better[c] > 0 ? "$\\uparrow$" : "$\\downarrow$", f);
    }
    fputs(" \\\\\n\\midrule\n", f);
    for (size_t r = 0; r < t->rows; r++) {
        table_latex_string(f, t->row[r].name);
        for (size_t c = 0; c < t->columns; c++) {
            bool best = table_is_best(t, r, c);
            fputs(best ? " & \\textbf{" : " & ", f);
            table_number(f, table_mean(t, r, c));
            fputs(best ? "}" : "", f);
        }
        fputs(" \\\\\n", f);
    }
    fputs("\\bottomrule\n\\end{tabular}\n", f);
}

void table_write(FILE *f, const struct table *t, enum table_format format)
{
    if (format == TABLE_JSON)
        table_put_json(f, table_json(t));
    else if (format == TABLE_LATEX)
        table_write_latex(f, t);
    else
        table_write_text(f, t, format == TABLE_TSV);
}
