/* Kinds of expression fitted to the labels of the assets' photographs and
 * clips. */
#include "lib/base/sort.h"
#include "lib/lab/people/scan_act.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/people/label_rows.h"
#include "lib/base/vec3.h"

#define ROUNDS 12               /* of the clustering */

struct act_seen {               /* weights of pictures, one after another */
    float (*w)[ARKIT_COUNT];
    float *column;              /* as long: of one weight, to be sorted */
    size_t n;
};

/* Pictures of one person or clip share the name before '#', or, of photographs,
 * before '_'. */
static size_t act_stem(const char *name)
{
    const char *hash = strchr(name, '#'), *base = strrchr(name, '/');
    const char *line = base ? strrchr(base, '_') : NULL;
    bool clip = strstr(name, "clips/") != NULL;

    if (!clip && line)
        return (size_t)(line - name);
    return hash ? (size_t)(hash - name) : strlen(name);
}

/* The rows from `first` on, of one person, become changes against their calm:
 * the fifth smallest of a hundred. */
static void act_take_calm(struct act_seen *s, size_t first)
{
    const size_t n = s->n - first;
    float (*w)[ARKIT_COUNT] = s->w + first;

    for (int k = 0; n && k < ARKIT_COUNT; k++) {
        for (size_t i = 0; i < n; i++)
            s->column[i] = w[i][k];
        sort_floats(s->column, n);
        const float calm = s->column[n / 20];
        for (size_t i = 0; i < n; i++)
            w[i][k] = clampf((float)label_gain(k) * (w[i][k] - calm), 0, 1);
    }
}

/* Room for n more pictures. */
static int act_grow(struct act_seen *s, size_t n, struct error *err)
{
    void *w = realloc(s->w, (s->n + n + 1) * sizeof *s->w);
    void *column = realloc(s->column, (s->n + n + 1) * sizeof *s->column);

    s->w = w ? w : s->w;
    s->column = column ? column : s->column;
    return w && column ? 0 : error_set(err, EX_OSERR, "out of memory (%zu "
                                       "pictures)", n);
}

/* The rows of a labels file, person by person, as weights of the expressions;
 * those of `real/` are left out. */
static int act_add_labels(struct act_seen *s, const struct label_rows *r,
                          struct error *err)
{
    const char *last = "";
    size_t first = s->n;

    if (act_grow(s, r->n, err))
        return -1;
    for (size_t i = 0; i < r->n; i++) {
        const char *name = r->name[i];
        const float *row = r->blend + i * r->columns;

        if (strncmp(last, name, act_stem(name) + 1)) {
            act_take_calm(s, first);
            first = s->n;
            last = name;
        }
        if (!strncmp(name, "real/", 5))
            continue;
        for (int k = 0; k < ARKIT_COUNT; k++)
            s->w[s->n][k] = r->column[k] < 0 ? 0 : row[r->column[k]];
        s->n++;
    }
    act_take_calm(s, first);
    return 0;
}

/* The kind whose mean is nearest to weights w. */
static int act_nearest(const struct act_model *m, const float *w)
{
    float min = 1e9f;
    int best = 0;

    for (int c = 0; c < m->kinds; c++) {
        float d = 0;

        for (int k = 0; k < ARKIT_COUNT; k++)
            d += (w[k] - m->mean[c][k]) * (w[k] - m->mean[c][k]);
        if (d < min) {
            min = d;
            best = c;
        }
    }
    return best;
}

/* One of Lloyd's rounds: means and deviations of what is nearest to each kind,
 * and how many those are. */
static void act_lloyd(struct act_model *m, float *count,
                      const struct act_seen *s)
{
    float sum[ACT_KINDS][ARKIT_COUNT] = {{0}};
    float two[ACT_KINDS][ARKIT_COUNT] = {{0}};

    memset(count, 0, ACT_KINDS * sizeof *count);
    for (size_t i = 0; i < s->n; i++) {
        const float *w = s->w[i];
        const int c = act_nearest(m, w);

        count[c] += 1;
        for (int k = 0; k < ARKIT_COUNT; k++) {
            sum[c][k] += w[k];
            two[c][k] += w[k] * w[k];
        }
    }
    for (int c = 0; c < m->kinds; c++)
        for (int k = 0; count[c] > 0 && k < ARKIT_COUNT; k++) {
            const float mean = sum[c][k] / count[c];

            m->mean[c][k] = mean;
            m->spread[c][k] = sqrtf(maxf(two[c][k] / count[c] - mean * mean,
                                         0));
        }
}

/* Lloyd's rounds from pictures spread over the list, and the kinds' shares. */
static void act_fit_kinds(struct act_model *m, const struct act_seen *s)
{
    float count[ACT_KINDS], share = 0;

    m->kinds = s->n < ACT_KINDS ? (int)s->n : ACT_KINDS;
    for (int c = 0; c < m->kinds; c++)
        memcpy(m->mean[c], s->w[(size_t)c * s->n / (size_t)m->kinds],
               sizeof m->mean[c]);
    for (int round = 0; round < ROUNDS; round++)
        act_lloyd(m, count, s);
    for (int c = 0; c < m->kinds; c++) {
        /* rare kinds come up more often than they were seen */
        count[c] = sqrtf(count[c]);
        share += count[c];
    }
    for (int c = 0; c < m->kinds; c++)
        m->share[c] = (c ? m->share[c - 1] : 0) + count[c] / share;
}

int act_model_fit(struct act_model *m, const char *dir, struct error *err)
{
    static const char *const file[2] = {"photos", "clips"};
    struct act_seen s = {0};
    int rc = 0;

    memset(m, 0, sizeof *m);
    for (int i = 0; !rc && i < 2; i++) {
        struct label_rows r;
        char path[4096];

        snprintf(path, sizeof path, "%s/labels/%s.safetensors", dir, file[i]);
        rc = label_rows_read(&r, path, err) || act_add_labels(&s, &r, err)
                 ? -1 : 0;
        label_rows_release(&r);
    }
    if (!rc && s.n < ACT_KINDS)
        rc = error_set(err, EX_DATAERR, "%s/labels: %zu pictures (expected "
                       "at least %d)", dir, s.n, ACT_KINDS);
    if (!rc)
        act_fit_kinds(m, &s);
    free(s.column);
    free(s.w);
    return rc;
}
