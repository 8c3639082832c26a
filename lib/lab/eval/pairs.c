/* Reading a list of pairs. */
#include "lib/lab/eval/pairs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/list.h"

#define PAIRS_MAX ((size_t)16 << 20)            /* of a list, bytes */

enum { FIELD_NAME, FIELD_KIND, FIELD_TRUTH, FIELD_RESULT, FIELD_PROTOCOL,
       FIELD_SOURCE, FIELDS };

/* One line into a pair. */
static int pairs_parse(struct pair *p, char *line, const char *path,
                       size_t number, struct error *err)
{
    char *field[FIELDS] = {NULL};
    int n = 0;

    for (char *rest = line; rest && n < FIELDS; n++)
        field[n] = strsep(&rest, "\t");
    if (n < FIELD_PROTOCOL)
        return error_set(err, EX_DATAERR, "%s: line %zu: not a pair (expected "
                         "name, frames or motion, truth, result and, "
                         "optional, protocol and source, with tabs between)",
                         path, number);
    *p = (struct pair){
        .name = field[FIELD_NAME],
        .motion = strcmp(field[FIELD_KIND], "motion") == 0,
        .truth = field[FIELD_TRUTH], .result = field[FIELD_RESULT],
        .protocol = field[FIELD_PROTOCOL], .source = field[FIELD_SOURCE]
    };
    if (!p->motion && strcmp(field[FIELD_KIND], "frames"))
        return error_set(err, EX_DATAERR, "%s: line %zu: %s (expected frames "
                         "or motion)", path, number, field[FIELD_KIND]);
    return 0;
}

int pairs_read(struct pairs *p, const char *path, struct error *err)
{
    size_t number = 0, room = 0;
    char *rest, *line;
    int rc = 0;

    memset(p, 0, sizeof *p);
    p->text = file_read_text(path, PAIRS_MAX, err);
    if (!p->text)
        return -1;
    for (rest = p->text; rc == 0 && (line = strsep(&rest, "\n"));) {
        number++;
        line[strcspn(line, "\r")] = 0;
        if (!*line || *line == '#')
            continue;
        struct pair *to = list_add(&p->pair, &p->count, &room, sizeof *to, err);
        rc = to ? pairs_parse(to, line, path, number, err) : -1;
    }
    if (rc == 0 && !p->count)
        rc = error_set(err, EX_DATAERR, "%s: no pairs", path);
    if (rc)
        pairs_release(p);
    return rc;
}

void pairs_release(struct pairs *p)
{
    free(p->pair);
    free(p->text);
    memset(p, 0, sizeof *p);
}

unsigned protocol_parse(const char *word)
{
    if (!word)
        return 0;
    return !strcmp(word, "self")    ? PROTOCOL_SELF
           : !strcmp(word, "cross") ? PROTOCOL_CROSS
                                    : 0;
}

void protocols_write(FILE *f, unsigned protocols, const char *mark)
{
    if (protocols & PROTOCOL_SELF)
        fprintf(f, "%sself: the source is the first frame of a clip, the "
                "driver that clip, the truth its frames\n", mark);
    if (protocols & PROTOCOL_CROSS)
        fprintf(f, "%scross: the source is the first frame of a clip, the "
                "driver the next identity's clip, the truth the driver's "
                "motion\n", mark);
    if (protocols & PROTOCOL_UNCHANGED)
        fprintf(f, "%s" PAIRS_UNCHANGED ": the truth's first frame in place "
                "of every later one; psnr_later and beats_0_pct are of the "
                "same frames\n", mark);
}
