/* Names that are collected before anything is opened. */
#include "lib/base/names.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/list.h"

#define LINES_MAX ((size_t)256 << 20)   /* bytes of a list */

int names_add(struct names *n, const char *name, struct error *err)
{
    char *own = strdup(name);
    char **to = list_add(&n->name, &n->count, &n->room, sizeof *to, err);

    if (!own || !to) {
        n->count -= to != NULL;
        free(own);
        return error_set(err, EX_OSERR, "no memory for names");
    }
    *to = own;
    return 0;
}

int names_add_folder(struct names *n, const char *path,
                     bool wanted(const char *entry), struct error *err)
{
    struct dirent **entry;
    const int all = scandir(path, &entry, NULL, versionsort);
    int found = 0;

    if (all < 0)
        return error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                         strerror(errno));
    for (int i = 0; i < all; i++) {
        char *name = NULL;

        if (found >= 0 && wanted(entry[i]->d_name)) {
            if (asprintf(&name, "%s/%s", path, entry[i]->d_name) < 0)
                found = error_set(err, EX_OSERR, "out of memory");
            else
                found = names_add(n, name, err) ? -1 : found + 1;
        }
        free(name);
        free(entry[i]);
    }
    free(entry);
    return found;
}

int names_add_lines(struct names *n, const char *path, struct error *err)
{
    char *text = file_read_text(path, LINES_MAX, err), *rest = text, *line;
    int rc = text ? 0 : -1;

    while (rc == 0 && (line = strsep(&rest, "\n"))) {
        line[strcspn(line, "\r")] = 0;
        if (*line && *line != '#')
            rc = names_add(n, line, err);
    }
    free(text);
    return rc;
}

void names_release(struct names *n)
{
    for (size_t i = 0; i < n->count; i++)
        free(n->name[i]);
    free(n->name);
    *n = (struct names){0};
}
