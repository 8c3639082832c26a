/* spid-head: write the toolkit's own head model, a safetensors file with
 * FLAME's arrays. */
#include "cmd/cli.h"
#include "lib/head/sculpt.h"

static const struct cli_option options[] = {{0}};

static const struct cli_usage usage = {
    "spid-head", "-o FILE [-j N] [-m MODEL] [-q] [--stats FILE]",
    "write the built-in head model", options
};

int main(int argc, char **argv)
{
    struct error err = {0};
    struct sculpt s;

    if (cli_parse(&usage, argc, argv) < argc)
        die(EX_USAGE, "operands are not taken");
    if (cli.output[0] == '-' && !cli.output[1])
        die(EX_USAGE, "no output file (expected -o FILE)");
    if (sculpt_make(&s, &err) || sculpt_save(&s, cli.output, &err))
        die_error(&err);
    sculpt_release(&s);
    stats_write();
    return EX_OK;
}
