/* The file of traits into numbers, each looked up by its name once. */
#include "lib/lab/people/traits.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "formats/jsonfile.h"
#include "lib/head/arkit.h"

static const char built_in[] =
#include "traits.json.inc"
;

static const struct trait {
    const char *name;
    size_t at, n;               /* bytes into the struct, numbers */
    bool is_double;
} traits[] = {
#define TRAIT_ROW(type, name, dimensions) \
    {#name, offsetof(struct traits, name), \
     sizeof ((struct traits *)0)->name / sizeof(type), \
     sizeof(type) == sizeof(double)},
    TRAITS(TRAIT_ROW)
};

#define TRAITS_MAX ((size_t)16 << 20)   /* bytes of a file */
#define NUMBERS 100             /* of a trait, at most */
#define TRAIT_MAX 1e6

/* The numbers of j and of the lists in it, in their order; *n counts also what
 * finds no room, and what is no number. */
static void traits_flatten(double *out, size_t *n, const cJSON *j)
{
    const cJSON *e;

    if (cJSON_IsArray(j)) {
        cJSON_ArrayForEach(e, j)
            traits_flatten(out, n, e);
        return;
    }
    if (!cJSON_IsNumber(j) || !(fabs(j->valuedouble) <= TRAIT_MAX))
        *n = NUMBERS;
    else if (*n < NUMBERS)
        out[*n] = j->valuedouble;
    ++*n;
}

static int traits_read(struct traits *t, const struct trait *f,
                       const cJSON *file, struct error *err)
{
    const cJSON *j = cJSON_GetObjectItemCaseSensitive(file, f->name);
    double v[NUMBERS];
    size_t n = 0;

    if (j)
        traits_flatten(v, &n, j);
    if (n != f->n)
        return error_set(err, EX_CONFIG, "%s: %s (expected %zu number%s)",
                         f->name, j ? "other numbers" : "missing", f->n,
                         plural(f->n));
    for (size_t i = 0; i < n; i++)
        if (f->is_double)
            memcpy((char *)t + f->at + i * sizeof *v, &v[i], sizeof *v);
        else
            memcpy((char *)t + f->at + i * sizeof(float),
                   &(float){(float)v[i]}, sizeof(float));
    return 0;
}

/* The object j: numbers by names of components, "mouthSmile" for both sides. */
static int traits_read_moves(struct trait_moves *m, const cJSON *j, size_t n,
                             const char *what, struct error *err)
{
    const cJSON *e;

    cJSON_ArrayForEach(e, j) {
        int k[2];
        char left[64];
        double v[NUMBERS];
        size_t found = 0;

        snprintf(left, sizeof left, "%s_L", e->string ? e->string : "");
        traits_flatten(v, &found, e);
        if (m->n == TRAIT_MOVES || found != n || !e->string
            || (!arkit_find(k, left) && !arkit_find(k, e->string)))
            return error_set(err, EX_CONFIG, "%s: %s (expected %zu number%s "
                             "by a name of ARKit's, %d times at most)", what,
                             e->string ? e->string : "a list", n,
                             plural(n), TRAIT_MOVES);
        m->move[m->n].component = k[0];
        for (size_t i = 0; i < n; i++)
            m->move[m->n].value[i] = (float)v[i];
        m->n++;
    }
    return m->n ? 0 : error_set(err, EX_CONFIG, "%s: missing", what);
}

/* Other names are remarks: one that is misspelt is missing. */
static int traits_read_all(struct traits *t, const cJSON *file,
                           struct error *err)
{
    const cJSON *e;

    memset(t, 0, sizeof *t);
    for (size_t i = 0; i < sizeof traits / sizeof *traits; i++)
        if (traits_read(t, &traits[i], file, err))
            return -1;
    cJSON_ArrayForEach(e, cJSON_GetObjectItemCaseSensitive(file, "expression"))
        if (t->expressions < TRAIT_MOVES
            && traits_read_moves(&t->expression[t->expressions++], e, 1,
                                 "expression", err))
            return -1;
    if (!t->expressions)
        return error_set(err, EX_CONFIG, "expression: missing");
    return traits_read_moves(&t->accent, cJSON_GetObjectItemCaseSensitive(
                             file, "accent"), 2, "accent", err);
}

int traits_load(struct traits *t, const char *path, struct error *err)
{
    cJSON *file = path ? jsonfile_read(path, TRAITS_MAX, err)
                       : cJSON_Parse(built_in);
    int rc = file ? traits_read_all(t, file, err) : -1;

    if (file && rc && path)
        error_prefix(err, "%s", path);
    cJSON_Delete(file);
    return rc;
}
