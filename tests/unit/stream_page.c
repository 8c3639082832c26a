/* man/spid-stream.5 and the table in lib/stream/schema.c say the same, and all
 * that the sources write is in them. */
#include "lib/stream/schema.h"

#include <glob.h>
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

/* Whether some record of the table has an array of this name. */
static int array_is_known(const char *name)
{
    for (const struct schema *s = schema_table(); s->type; s++)
        if (strcmp(s->name, name) == 0)
            return 1;
    return 0;
}

/* Arrays that a source makes and the table has not; *made: how many it
 * makes. */
static int count_unknown(const char *path, int *made)
{
    static const char call[] = "array_make(\"";
    FILE *f = fopen(path, "r");
    int unknown = 0;
    char line[512], name[32];

    while (f && fgets(line, sizeof line, f)) {
        const char *at = strstr(line, call);

        if (!at || sscanf(at + strlen(call), "%31[a-z]", name) != 1)
            continue;
        ++*made;
        if (array_is_known(name))
            continue;
        printf("FAILED %s writes '%s', which no record has\n", path, name);
        unknown++;
    }
    if (f)
        fclose(f);
    return unknown;
}

/* In all sources but the laboratory's, which times records of its own. */
static int count_all_unknown(void)
{
    int made = 0, unknown = 0;
    glob_t g;

    if (glob("lib/*/*.c", 0, NULL, &g))
        return 1;
    glob("cmd/*.c", GLOB_APPEND, NULL, &g);
    glob("cmd/lab/*.c", GLOB_APPEND, NULL, &g);
    for (size_t i = 0; i < g.gl_pathc; i++)
        unknown += count_unknown(g.gl_pathv[i], &made);
    globfree(&g);
    printf("%d places write an array, %d of them one that is in no record\n",
           made, unknown);
    return unknown + (made == 0);
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
    failed += count_all_unknown();
    return failed || rows != listed;
}
