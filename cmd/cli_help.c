/* --help: the usage line of the manual page's SYNOPSIS and a line or two for
 * every option. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli_parts.h"

/* One option: its names and value, then what it does. */
static void cli_help_option(const struct cli_option *o)
{
    char left[80];

    snprintf(left, sizeof left, "%s%c%s--%s%s%s", o->letter ? "-" : " ",
             o->letter ? o->letter : ' ', o->letter ? ", " : "  ", o->name,
             o->arg ? "=" : "", o->arg ? o->arg : "");
    if (strlen(left) > 24)
        printf("  %s\n  %-24s  %s\n", left, "", o->help);
    else
        printf("  %-24s  %s\n", left, o->help);
}

void cli_print_help(const struct cli_usage *u,
                    const struct cli_option *all, int n)
{
    printf("Usage: %s %s\n\n%s\n\n", u->program, u->synopsis, u->purpose);
    for (int i = 0; i < n; i++)
        cli_help_option(&all[i]);
    printf("\nSee %s(1) for the rest.\n", u->program);
    if (fflush(stdout))
        die(EX_IOERR, "<stdout>: cannot write: %s", strerror(errno));
    exit(0);
}
