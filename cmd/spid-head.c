/* spid-head: write the toolkit's own head model, a safetensors file with
 * FLAME's arrays, and pictures of it to look at. */
#include <string.h>

#include "cmd/cli.h"
#include "lib/head/sculpt.h"
#include "lib/head/sculpt_sheet.h"

static const char *sheet;
static long size = 300;

static const struct cli_option options[] = {
    { "sheet", 0, CLI_STRING, &sheet, 0, 0, "FILE",
      "also draw views, people and expressions (PNG)", NULL },
    { "size", 0, CLI_INT, &size, 32, 1024, "N",
      "pixels across one picture of the sheet", NULL },
    { 0 }
};

static const struct cli_usage usage = {
    "spid-head",
    "-o FILE [--sheet FILE] [--size N] [-j N] [-m MODEL] [-q] [--stats FILE]",
    "write the built-in head model", options
};

int main(int argc, char **argv)
{
    struct error err = {0};
    struct sculpt s;

    if (cli_parse(&usage, argc, argv) < argc)
        die(EX_USAGE, "operands are not taken");
    if (!strcmp(cli.output, "-") && !sheet)
        die(EX_USAGE, "no output file (expected -o FILE)");
    double begun = stats_begin();
    if (sculpt_make(&s, &err))
        die_error(&err);
    stats_end("sculpt", begun);
    if (strcmp(cli.output, "-") && sculpt_save(&s, cli.output, &err))
        die_error(&err);
    if (sheet && sculpt_sheet(sheet, &s, (size_t)size, &err))
        die_error(&err);
    sculpt_release(&s);
    stats_write();
    return EX_OK;
}
