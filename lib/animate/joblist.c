/* Reading a list of clips, checked as a whole before the first is made. */
#include "lib/animate/joblist.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/list.h"

#define LIST_MAX ((size_t)64 << 20)

/* Cut one line into its three fields. */
static int joblist_cut(struct job *j, char *line)
{
    char *a = strchr(line, '\t'), *b = a ? strchr(a + 1, '\t') : NULL;

    if (!a || !b || strchr(b + 1, '\t') || a == line || b == a + 1 || !b[1])
        return -1;
    *a = *b = 0;
    *j = (struct job){line, a + 1, b + 1};
    return 0;
}

/* Order of qsort: by output name. */
static int joblist_by_out(const void *a, const void *b)
{
    return strcmp((*(const struct job *const *)a)->out,
                  (*(const struct job *const *)b)->out);
}

/* No output may stand twice. */
static int joblist_check_outputs(const struct joblist *l, const char *path,
                                 struct error *err)
{
    const struct job **sorted = malloc((l->count + 1) * sizeof *sorted);
    int rc = 0;

    if (!sorted)
        return error_set(err, EX_OSERR, "no memory for a list");
    for (size_t i = 0; i < l->count; i++)
        sorted[i] = &l->job[i];
    qsort(sorted, l->count, sizeof *sorted, joblist_by_out);
    for (size_t i = 1; i < l->count && rc == 0; i++)
        if (strcmp(sorted[i]->out, sorted[i - 1]->out) == 0)
            rc = error_set(err, EX_DATAERR, "%s: output %s stands on two "
                           "lines", path, sorted[i]->out);
    free(sorted);
    return rc;
}

int joblist_read(struct joblist *l, const char *path, struct error *err)
{
    size_t number = 0, room = 0;
    char *rest;

    memset(l, 0, sizeof *l);
    l->text = rest = file_read_text(path, LIST_MAX, err);
    if (!rest)
        return -1;
    for (char *line; (line = strsep(&rest, "\n"));) {
        number++;
        line[strcspn(line, "\r")] = 0;
        if (!*line || *line == '#')
            continue;
        struct job *p = list_add(&l->job, &l->count, &room, sizeof *p, err);
        if (!p || joblist_cut(p, line)) {
            joblist_release(l);
            return !p ? -1 : error_set(err, EX_DATAERR, "%s: line %zu: not three "
                             "fields (expected SOURCE, DRIVER and OUT with "
                             "tabs between)", path, number);
        }
    }
    if (joblist_check_outputs(l, path, err)) {
        joblist_release(l);
        return -1;
    }
    return 0;
}

void joblist_release(struct joblist *l)
{
    free(l->job);
    free(l->text);
    memset(l, 0, sizeof *l);
}
