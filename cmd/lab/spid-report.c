/* spid-report: a run's folder as one self-contained HTML page. */
#include "cmd/cli.h"
#include "formats/outfile.h"
#include "lib/lab/report/report.h"

static const char *sheet;

static const struct cli_option options[] = {
    OPTION_OUTPUT("sheet", 0, &sheet, "FILE",
                  "also write a contact sheet (PNG)"),
    {0}
};

static const struct cli_usage usage = {
    "spid-report", "[OPTION ...] RUN",
    "write one HTML page of a run: videos, motion, pictures, times, metrics",
    options};

int main(int argc, char **argv)
{
    struct error err = {0}, none;
    struct outfile out;
    char card[4096];
    int at = cli_parse(&usage, argc, argv);

    if (at != argc - 1)
        die(EX_USAGE, "%s (expected one folder)",
            at == argc ? "no run named" : "more than one operand");
    if (sheet && report_sheet(sheet, argv[at], &err))
        die_error(&err);
    if (outfile_open(&out, cli.output, &err))
        die_error(&err);
    if (cli_find_model("README.md", card, sizeof card, &none))
        card[0] = '\0';
    if (report_write(out.file, argv[at], card[0] ? card : NULL, &err)) {
        outfile_abandon(&out);
        die_error(&err);
    }
    if (outfile_close(&out, &err))
        die_error(&err);
    return EX_OK;
}
