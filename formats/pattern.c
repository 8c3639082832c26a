/* Numbered names (pattern.h). */
#include "formats/pattern.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/base/sort.h"

int pattern_count(const char *path)
{
    int found = 0;

    for (const char *p = path; (p = strchr(p, '%')) != NULL; p++) {
        const char *q = p + 1;

        if (*q == '%') {
            p = q;
            continue;
        }
        q += strspn(q, "0123456789");
        if (*q != 'd' || q - p > 3)
            return -1;
        found++;
    }
    return found;
}

char *pattern_name(const char *path, uint64_t n)
{
    size_t size = strlen(path) + 128, at = 0;
    char *name = malloc(size);

    for (const char *p = path; name && *p; p++) {
        if (p[0] != '%') {
            name[at++] = *p;
        } else if (p[1] == '%') {
            name[at++] = *++p;
        } else {
            int zero = p[1] == '0', width = atoi(p + 1);

            at += (size_t)snprintf(name + at, size - at,
                                   zero ? "%0*llu" : "%*llu", width,
                                   (unsigned long long)n);
            p = strchr(p, 'd');
        }
    }
    if (name)
        name[at] = 0;
    return name;
}

/* ---- what is there ------------------------------------------------------- */

/* Whether `file` is the name of some frame, and of which. */
static int pattern_match(const char *pattern, const char *file, uint64_t *n)
{
    for (const char *p = file; *p; p++) {
        char *name;
        int same;

        if (*p < '0' || *p > '9')
            continue;
        errno = 0;
        *n = strtoull(p, NULL, 10);
        name = errno ? NULL : pattern_name(pattern, *n);
        same = name && !strcmp(name, file);
        free(name);
        if (same)
            return 1;
    }
    return 0;
}

/* The numbers of all frames in a folder, sorted, for the caller to free. */
static uint64_t *pattern_list(const char *folder, const char *pattern,
                              size_t *count, struct error *err)
{
    DIR *dir = opendir(folder);
    uint64_t *list = NULL;
    size_t room = 0;
    struct dirent *e;

    *count = 0;
    if (!dir)
        return error_null(err, EX_NOINPUT, "%s: cannot open: %s", folder,
                          strerror(errno));
    while ((e = readdir(dir))) {
        uint64_t n, *to;

        if (!pattern_match(pattern, e->d_name, &n))
            continue;
        to = list_add(&list, count, &room, sizeof *list, err);
        if (!to) {
            free(list);
            closedir(dir);
            return NULL;
        }
        *to = n;
    }
    closedir(dir);
    if (list)
        sort_keys(list, *count);
    else
        error_set(err, EX_NOINPUT, "%s/%s: there is no such file", folder,
                  pattern);
    return list;
}

/* The first number that is missing between two that are there. */
static int pattern_check_gaps(const char *path, const uint64_t *list,
                              size_t count, struct error *err)
{
    for (size_t i = 1; i < count; i++) {
        char *lost;

        if (list[i] == list[i - 1] + 1)
            continue;
        lost = pattern_name(path, list[i - 1] + 1);
        error_set(err, EX_NOINPUT, "%s: %s is missing: numbers %llu to %llu "
                  "are there, then %llu (a folder takes what there is)", path,
                  lost ? lost : "a picture", (unsigned long long)list[0],
                  (unsigned long long)list[i - 1],
                  (unsigned long long)list[i]);
        free(lost);
        return -1;
    }
    return 0;
}

int pattern_find(const char *path, uint64_t *first, uint64_t *last,
                 struct error *err)
{
    const char *slash = strrchr(path, '/');
    char *folder = slash == path ? strdup("/")
                 : slash ? strndup(path, (size_t)(slash - path)) : strdup(".");
    uint64_t *list = NULL;
    size_t count;
    int rc = -1;

    if (!folder) {
        error_set(err, EX_OSERR, "out of memory");
    } else if (pattern_count(folder) != 0) {
        error_set(err, EX_USAGE, "%s: a number in the folder's name (expected "
                  "one in the file's)", path);
    } else if ((list = pattern_list(folder, slash ? slash + 1 : path, &count,
                                    err))) {
        *first = list[0];
        *last = list[count - 1];
        rc = pattern_check_gaps(path, list, count, err);
    }
    free(list);
    free(folder);
    return rc;
}
