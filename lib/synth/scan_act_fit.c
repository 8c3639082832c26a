/* Kinds of expression fitted to the labels of the assets' photographs and
 * clips. */
#include "lib/synth/scan_act.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/base/random.h"
#include "lib/synth/vec.h"

#define LABELS 52

struct seen {                   /* weights of pictures, one after another */
    float (*w)[ARKIT_COUNT];
    size_t n;
};

/* How the labels' scale differs from a weight of 1: their full blink is 0.6,
 * talking jaws 0.4. */
static float label_gain(int k)
{
    if (k == ARKIT_EYE_BLINK_L || k == ARKIT_EYE_BLINK_R)
        return 1.5f;
    return k == ARKIT_JAW_OPENED ? 1.25f : 1.1f;
}

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

static int act_compare(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;

    return x < y ? -1 : x > y;
}

/* The rows lo..hi-1 of one person become changes against their calm: the
 * fifth smallest of a hundred. */
static void take_calm(float (*w)[ARKIT_COUNT], size_t n)
{
    float *v = malloc((n + 1) * sizeof *v);

    for (int k = 0; v && k < ARKIT_COUNT; k++) {
        for (size_t i = 0; i < n; i++)
            v[i] = w[i][k];
        qsort(v, n, sizeof *v, act_compare);
        float calm = v[n / 20];
        for (size_t i = 0; i < n; i++)
            w[i][k] = clampf(label_gain(k) * (w[i][k] - calm), 0, 1);
    }
    free(v);
}

/* Columns of the labels that our components take. */
static int find_columns(int column[ARKIT_COUNT], const struct safetensors *st,
                        struct error *err)
{
    const char *text = st_meta(st, "blendshape_names");
    cJSON *names = text ? cJSON_Parse(text) : NULL;
    int rc = cJSON_GetArraySize(names) == LABELS ? 0 : -1;

    for (int k = 0; k < ARKIT_COUNT; k++)
        column[k] = -1;
    for (int i = 0; !rc && i < LABELS; i++) {
        const cJSON *n = cJSON_GetArrayItem(names, i);
        int c[2], m = cJSON_IsString(n) ? arkit_find(c, n->valuestring) : 0;
        for (int j = 0; j < m; j++)
            column[c[j]] = i;
    }
    cJSON_Delete(names);
    return rc ? error_set(err, EX_DATAERR, "%s: no %d blendshape_names "
                          "(expected ARKit's)", st_path(st), LABELS) : 0;
}

/* The rows of a labels file, as weights of the expressions. */
static int add_labels(struct seen *s, const struct safetensors *st,
                      struct error *err)
{
    size_t dims[2] = {0, LABELS}, n;
    int column[ARKIT_COUNT];
    const char *text = st_meta(st, "names");

    if (find_columns(column, st, err))
        return -1;
    float *b = st_load_f32(st, "blendshapes", 2, dims, &n, err);
    cJSON *names = text ? cJSON_Parse(text) : NULL;
    n /= LABELS;
    float (*w)[ARKIT_COUNT] = b ? realloc(s->w, (s->n + n + 1) * sizeof *w)
                                : NULL;
    int rc = 0;
    if (!w || (size_t)cJSON_GetArraySize(names) != n) {
        rc = b ? error_set(err, EX_DATAERR, "%s: names: expected a list of "
                           "%zu", st_path(st), n) : -1;
    }
    if (w)
        s->w = w;
    size_t first = s->n;
    const char *last = "";
    const cJSON *name = rc ? NULL : names->child;
    for (size_t i = 0; !rc && i < n; i++, name = name->next) {
        const char *t = cJSON_IsString(name) ? name->valuestring : "real/";
        if (strncmp(last, t, act_stem(t) + 1)) {
            take_calm(s->w + first, s->n - first);
            first = s->n;
            last = t;
        }
        if (!strncmp(t, "real/", 5))
            continue;
        for (int k = 0; k < ARKIT_COUNT; k++)
            s->w[s->n][k] = column[k] < 0 ? 0
                            : b[i * LABELS + (size_t)column[k]];
        s->n++;
    }
    take_calm(s->w + first, s->n - first);
    cJSON_Delete(names);
    free(b);
    return rc;
}

/* Lloyd's rounds from pictures spread over the list; then means, deviations
 * and shares. */
static void fit_kinds(struct act_model *m, const struct seen *s)
{
    float count[ACT_KINDS], share = 0;

    m->kinds = s->n < ACT_KINDS ? (int)s->n : ACT_KINDS;
    for (int c = 0; c < m->kinds; c++)
        memcpy(m->mean[c], s->w[(size_t)c * s->n / (size_t)m->kinds],
               sizeof m->mean[c]);
    for (int round = 0; round < 12; round++) {
        float sum[ACT_KINDS][ARKIT_COUNT] = {{0}};
        float two[ACT_KINDS][ARKIT_COUNT] = {{0}};
        memset(count, 0, sizeof count);
        for (size_t i = 0; i < s->n; i++) {
            int best = 0;
            float least = 1e9f;
            for (int c = 0; c < m->kinds; c++) {
                float d = 0;
                for (int k = 0; k < ARKIT_COUNT; k++)
                    d += (s->w[i][k] - m->mean[c][k])
                         * (s->w[i][k] - m->mean[c][k]);
                if (d < least) {
                    least = d;
                    best = c;
                }
            }
            count[best] += 1;
            for (int k = 0; k < ARKIT_COUNT; k++) {
                sum[best][k] += s->w[i][k];
                two[best][k] += s->w[i][k] * s->w[i][k];
            }
        }
        for (int c = 0; c < m->kinds; c++)
            for (int k = 0; count[c] > 0 && k < ARKIT_COUNT; k++) {
                float mean = sum[c][k] / count[c];
                m->mean[c][k] = mean;
                m->spread[c][k] = sqrtf(maxf(two[c][k] / count[c]
                                              - mean * mean, 0));
            }
    }
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
    struct seen s = {0};
    int rc = 0;

    memset(m, 0, sizeof *m);
    for (int i = 0; !rc && i < 2; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/labels/%s.safetensors", dir, file[i]);
        struct safetensors *st = st_open(path, err);
        rc = st ? add_labels(&s, st, err) : -1;
        st_close(st);
    }
    if (!rc && s.n < ACT_KINDS)
        rc = error_set(err, EX_DATAERR, "%s/labels: %zu pictures (expected "
                       "at least %d)", dir, s.n, ACT_KINDS);
    if (!rc)
        fit_kinds(m, &s);
    free(s.w);
    return rc;
}
