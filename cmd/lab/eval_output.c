/* The table of spid-eval and what is said below it. */
#include "cmd/lab/eval_output.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "cmd/cli.h"
#include "formats/outfile.h"
#include "lib/lab/eval/summary.h"

/* A line for each of the paper's columns that is not in the table. */
static void eval_output_missing(FILE *f, const struct compare_nets *nets,
                                const char *mark)
{
    static const char line[] = "%s%s: not run: needs weights (--%s)\n";

    if (!nets->lpips)
        fprintf(f, line, mark, "lpips", "lpips");
    if (!nets->likeness)
        fprintf(f, line, mark, "arcface", "arcface");
    if (!nets->musiq)
        fprintf(f, line, mark, "musiq", "musiq");
    fprintf(f, "%stopiq: not run: is not computed here\n", mark);
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
    const bool named = strcmp(cli.output, "-") != 0;
    struct outfile out = {.file = stdout};
    struct error err = {0};

    if (named && outfile_open(&out, cli.output, &err))
        die_error(&err);
    if (o->summary && o->format == TABLE_JSON)
        summary_write(out.file, t);
    else
        table_write(out.file, t, o->format);
    eval_output_remarks(out.file, o);
    if (named ? outfile_close(&out, &err) : fflush(stdout) || ferror(stdout)) {
        if (!named)
            error_set(&err, EX_IOERR, "<stdout>: %s", strerror(errno));
        die_error(&err);
    }
}
