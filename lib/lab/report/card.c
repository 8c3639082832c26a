/* A model card's limits: bullets of Markdown, as HTML. */
#include "lib/lab/report/card.h"

#include <errno.h>
#include <stdbool.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/report/html.h"

/* Text without Markdown's marks for code. */
static void card_write_text(FILE *f, char *text)
{
    char *to = text;

    for (const char *p = text; *p; p++)
        if (*p != '`' && *p != '\n')
            *to++ = *p;
    *to = '\0';
    html_text(f, text);
}

int card_write_limits(FILE *f, const char *path, struct error *err)
{
    FILE *in = fopen(path, "r");
    char line[1024];
    bool here = false, item = false;

    if (!in)
        return error_set(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
    while (fgets(line, sizeof line, in)) {
        if (strncmp(line, "## ", 3) == 0) {
            if (here && item)
                break;
            here = strncmp(line, "## Limits", 9) == 0;
        } else if (here && strncmp(line, "- ", 2) == 0) {
            fputs(item ? "</li>\n<li>" : "<ul>\n<li>", f);
            card_write_text(f, line + 2);
            item = true;
        } else if (item && line[strspn(line, " \n")]) {
            fputc(' ', f);
            card_write_text(f, line + strspn(line, " "));
        }
    }
    fclose(in);
    if (item)
        fputs("</li>\n</ul>\n", f);
    return item ? 0 : 1;
}
