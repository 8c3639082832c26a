/* Reading the labels' files, and sorting their rows by person, clip and
 * frame. */
#include "lib/lab/fit/labels.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/inputs.h"
#include "lib/lab/people/label_rows.h"

/* ---- reading ------------------------------------------------------------- */

/* Row i of the file at path to l; -1 too when its name is no "file#frame". */
static int label_append(struct labels *l, const struct label_rows *r,
                        size_t i, const char *path, struct error *err)
{
    struct label *to = &l->label[l->count];
    const char *name = r->name[i], *hash = strrchr(name, '#');
    char *end = NULL;
    unsigned long long frame = hash ? strtoull(hash + 1, &end, 10) : 0;

    if (!hash || hash == name || !isdigit((unsigned char)hash[1]) || *end)
        return error_set(err, EX_DATAERR, "%s: name %zu is '%.80s' (expected "
                         "FILE#FRAME)", path, i, name);
    *to = (struct label){.frame = frame};
    for (int p = 0; p < LANDMARK_COUNT; p++)
        for (int c = 0; c < 2; c++) {
            double x = (double)r->landmark[i][p][c];

            if (fabs(x) > 1e6)
                return error_set(err, EX_DATAERR, "%s: landmarks: row %zu, "
                                 "point %d is %g (expected pixels)", path, i,
                                 p, x);
            to->at[p][c] = x;
        }
    for (int k = 0; k < ARKIT_COUNT; k++)
        if (r->column[k] >= 0)
            to->blend[k] = fmin(fmax((double)r->blend[
                i * r->columns + (size_t)r->column[k]], 0), 1);
    to->file = strndup(name, (size_t)(hash - name));
    if (!to->file)
        return error_set(err, EX_OSERR, "out of memory");
    l->count++;
    return 0;
}

bool label_is_named(const char *name, const struct label_names *of)
{
    for (size_t i = 0; i < of->n; i++)
        if (!strncmp(name, of->begin[i], strlen(of->begin[i])))
            return true;
    return false;
}

int labels_read(struct labels *l, const char *path,
                const struct label_names *except, struct error *err)
{
    struct label_rows r;
    struct label *grown = NULL;
    int rc = label_rows_read(&r, path, err);

    if (rc == 0 &&
        !(grown = realloc(l->label, (l->count + r.n + 1) * sizeof *grown)))
        rc = error_set(err, EX_OSERR, "out of memory");
    l->label = grown ? grown : l->label;
    for (size_t i = 0; i < r.n && rc == 0; i++)
        if (r.found[i] && !label_is_named(r.name[i], except))
            rc = label_append(l, &r, i, path, err);
    label_rows_release(&r);
    return rc;
}

void labels_release(struct labels *l)
{
    for (size_t i = 0; i < l->count; i++)
        free(l->label[i].file);
    free(l->label);
    memset(l, 0, sizeof *l);
}

/* ---- whose --------------------------------------------------------------- */

/* A stretch of a name. */
struct label_stem {
    const char *from;
    size_t n;
};

static bool label_stem_is(struct label_stem a, struct label_stem b)
{
    return a.n == b.n && !memcmp(a.from, b.from, a.n);
}

/* Name without folder and extension. */
static struct label_stem label_base(const char *file)
{
    const char *slash = strrchr(file, '/'), *dot = strrchr(file, '.');
    const char *from = slash ? slash + 1 : file;

    return (struct label_stem){
        from, dot > from ? (size_t)(dot - from) : strlen(from)
    };
}

static bool label_is_picture(const char *file)
{
    return inputs_is_picture(label_base(file).from);
}

/* What a picture's name says about who it is. */
static struct label_stem label_who(const char *file)
{
    struct label_stem s = label_base(file);
    const char *line = memrchr(s.from, '_', s.n);
    size_t all = s.n;

    if (!label_is_picture(file))
        return s;
    if (line) {
        s.n = (size_t)(line - s.from);
        return s;
    }
    while (s.n && isdigit((unsigned char)s.from[s.n - 1]))
        s.n--;
    while (s.n && isdigit((unsigned char)*s.from)) {
        s.from++;
        s.n--;
    }
    return s.n ? s : (struct label_stem){s.from, all};
}

/* Whether two files show one person, by their names alone. */
static bool label_is_same(const char *a, const char *b)
{
    const char *x = strrchr(a, '/'), *y = strrchr(b, '/');
    struct label_stem folder = {a, x ? (size_t)(x - a) : 0};
    struct label_stem other = {b, y ? (size_t)(y - b) : 0};

    return !strcmp(a, b) ||
           (label_is_picture(a) && label_is_picture(b) &&
            label_stem_is(folder, other) &&
            label_stem_is(label_who(a), label_who(b)));
}

/* The person of the first label called name; -1: none. */
static long label_find(const struct labels *l, const char *name)
{
    struct label_stem want = {name, strlen(name)};

    for (size_t i = 0; i < l->count; i++)
        if (label_stem_is(label_base(l->label[i].file), want))
            return (long)l->label[i].person;
    return -1;
}

/* Everyone gets the number of the first label of theirs. */
static void labels_number(struct labels *l)
{
    for (size_t i = 0; i < l->count; i++) {
        struct label *a = &l->label[i];

        a->person = a->clip = i;
        for (size_t k = 0; k < i; k++) {
            const struct label *b = &l->label[k];

            if (b->person == k && label_is_same(a->file, b->file))
                a->person = k;
            if (b->clip == k && !strcmp(a->file, b->file))
                a->clip = k;
        }
    }
}

/* The people of a pair of names become one. */
static int labels_join(struct labels *l, const char *const pair[2],
                       struct error *err)
{
    long who[2];

    for (int k = 0; k < 2; k++) {
        who[k] = label_find(l, pair[k]);
        if (who[k] < 0)
            return error_set(err, EX_DATAERR, "no label is called '%s' "
                             "(expected a name without folder and "
                             "extension)", pair[k]);
    }
    for (size_t i = 0; i < l->count; i++)
        if ((long)l->label[i].person == who[1])
            l->label[i].person = (size_t)who[0];
    return 0;
}

/* By person, clip, frame. */
static int label_order(const void *a, const void *b)
{
    const struct label *x = a, *y = b;

    if (x->person != y->person)
        return x->person < y->person ? -1 : 1;
    if (x->clip != y->clip)
        return x->clip < y->clip ? -1 : 1;
    return x->frame < y->frame ? -1 : x->frame > y->frame;
}

int labels_sort(struct labels *l, const char *const (*same)[2], size_t nsame,
                struct error *err)
{
    size_t person = 0, clip = 0;

    if (!l->count)
        return error_set(err, EX_DATAERR, "no labelled face");
    labels_number(l);
    for (size_t i = 0; i < nsame; i++)
        if (labels_join(l, same[i], err))
            return -1;
    qsort(l->label, l->count, sizeof *l->label, label_order);
    l->people = l->clips = 0;
    for (size_t i = 0; i < l->count; i++) {
        bool other = !i || l->label[i].person != person;

        if (!i || l->label[i].clip != clip)
            l->clips++;
        clip = l->label[i].clip;
        person = l->label[i].person;
        l->people += other;
        l->label[i].clip = l->clips - 1;
        l->label[i].person = l->people - 1;
    }
    return 0;
}
