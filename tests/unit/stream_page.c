/* man/spid-stream.5 and the table in lib/stream/schema.c say the same. */
#include "lib/stream/schema.h"

#include <stdio.h>
#include <string.h>

/* The page's rows of one type follow the one that names it. */
static int find_row(FILE *f, const struct schema *s)
{
    char line[512], row[200], type[8] = "";

    snprintf(row, sizeof row, " Ta %s%s Ta %s Ta [%s] Ta ", s->name,
             s->required ? "" : "\\(dg",
             strchr(s->dtypes, ' ') ? "f16 or f32" : s->dtypes, s->shape);
    rewind(f);
    while (fgets(line, sizeof line, f)) {
        if (strncmp(line, ".It ", 4) == 0 && strncmp(line + 4, "\"\"", 2))
            snprintf(type, sizeof type, "%.4s", line + 4);
        if (strcmp(type, s->type) == 0 && strstr(line, row))
            return 1;
    }
    printf("FAILED no row '%s%s'\n", s->type, row);
    return 0;
}

int main(void)
{
    FILE *f = fopen("man/spid-stream.5", "r");
    int rows = 0, failed = 0, listed = 0;
    char line[512];

    if (!f)
        return puts("run from the source tree"), 77;
    for (const struct schema *s = schema_table(); s->type; s++, rows++)
        failed += !find_row(f, s);
    rewind(f);
    while (fgets(line, sizeof line, f))
        listed += strstr(line, " Ta [") != NULL;
    fclose(f);
    printf("%d arrays in the table, %d in the page\n", rows, listed);
    return failed || rows != listed;
}
