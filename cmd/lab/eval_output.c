/* The table of spid-eval and what is said below it. */
#include "cmd/lab/eval_output.h"

#include <stdio.h>

#include "cmd/cli.h"
#include "formats/outfile.h"
#include "lib/lab/eval/people.h"

/* A line for each of the paper's columns that is not in the table. */
static void eval_output_missing(FILE *f, const struct compare_nets *nets,
                                const char *mark)
{
    const struct {
        const char *name;
        const void *net;
    } column[] = {{"lpips", nets->lpips}, {"arcface", nets->likeness},
                  {"musiq", nets->musiq}, {"topiq", nets->topiq}};

    for (size_t i = 0; i < sizeof column / sizeof *column; i++)
        if (!column[i].net)
            fprintf(f, "%s%s: not run: needs weights (--%s)\n", mark,
                    column[i].name, column[i].name);
}

/* What stands below a table of this format. */
static void eval_output_remarks(FILE *f, const struct eval_output *o)
{
    const char *mark = o->format == TABLE_LATEX ? "% " : "# ";

    if (o->format == TABLE_JSON)
        return;
    protocols_write(f, o->protocols, mark);
    if (o->nets)
        eval_output_missing(f, o->nets, mark);
}

void eval_output_write(const struct table *t, const struct eval_output *o)
{
    struct outfile out;
    struct error err = {0};

    if (outfile_open_text(&out, cli.output, &err))
        die_error(&err);
    if (o->summary && o->format == TABLE_JSON)
        summary_write(out.file, t);
    else
        table_write(out.file, t, o->format);
    eval_output_remarks(out.file, o);
    if (outfile_close(&out, &err))
        die_error(&err);
}
