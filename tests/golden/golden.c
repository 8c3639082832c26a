/* golden DIR...: run every case file found under DIR with code under test. */
#include "tests/golden/golden.h"

#include <ftw.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/random.h"

/* ---- the formula -------------------------------------------------------- */

static double golden_unit(uint64_t key, uint64_t i)
{
    return (double)(random_mix(key + i) >> 40) / 16777216.0;
}

double golden_u(const char *name, uint64_t seed, uint64_t i)
{
    return golden_unit(random_name(name) ^ seed, i);
}

static float golden_value(uint64_t key, uint64_t i, double offset, double bound)
{
    return (float)(offset + bound * (2.0 * golden_unit(key, i) - 1.0));
}

float golden_v(const char *name, uint64_t seed, uint64_t i, double offset,
               double bound)
{
    return golden_value(random_name(name) ^ seed, i, offset, bound);
}

double golden_probe(uint64_t seed, uint64_t i)
{
    return 2 * golden_u("probe", seed, i) - 1;
}

static void *golden_grab(size_t n, size_t size)
{
    void *p = calloc(n + 1, size);

    if (!p) {
        fprintf(stderr, "golden: out of memory\n");
        exit(EX_OSERR);
    }
    return p;
}

float *golden_array(const char *name, uint64_t seed, size_t n, double offset,
                    double bound)
{
    float *x = golden_grab(n, sizeof *x);
    uint64_t key = random_name(name) ^ seed;

    for (size_t i = 0; i < n; i++)
        x[i] = golden_value(key, i, offset, bound);
    return x;
}

float *golden_probe_array(uint64_t seed, size_t n)
{
    return golden_array("probe", seed, n, 0, 1);
}

float *golden_image(const char *name, uint64_t seed, size_t planes, size_t h,
                    size_t w, bool signed_range)
{
    char coarse[128];
    float *x = golden_grab(planes * h * w, sizeof *x);
    size_t gh = (h + 15) / 16, gw = (w + 15) / 16, i = 0;

    snprintf(coarse, sizeof coarse, "%s.coarse", name);
    uint64_t kc = random_name(coarse) ^ seed, kf = random_name(name) ^ seed;
    for (size_t c = 0; c < planes; c++)
        for (size_t y = 0; y < h; y++)
            for (size_t u = 0; u < w; u++, i++) {
                size_t cell = (c * gh + y / 16) * gw + u / 16;
                float v = (float)(0.75 * golden_unit(kc, cell)
                                  + 0.25 * golden_unit(kf, i));

                x[i] = signed_range ? (float)(2.0 * v - 1.0) : v;
            }
    return x;
}

/* ---- what the case file says -------------------------------------------- */

static _Noreturn void golden_broken(const struct golden *g, const char *what)
{
    fprintf(stderr, "golden: %s: no '%s'\n", g->path, what);
    exit(EX_DATAERR);
}

const char *golden_meta(const struct golden *g, const char *key)
{
    const char *v = st_meta(g->st, key);

    if (!v)
        golden_broken(g, key);
    return v;
}

double golden_number(const struct golden *g, const char *key)
{
    return strtod(golden_meta(g, key), NULL);
}

cJSON *golden_json(const struct golden *g, const char *key)
{
    const char *v = st_meta(g->st, key);

    return v ? cJSON_Parse(v) : NULL;
}

void golden_input_shape(size_t in[4], const struct golden *g)
{
    static const int from[4] = {0, 2, 3, 1};
    cJSON *shape = golden_json(g, "input_shape");

    for (int i = 0; i < 4; i++)
        in[i] = (size_t)cJSON_GetNumberValue(
            cJSON_GetArrayItem(shape, from[i]));
    cJSON_Delete(shape);
}

void golden_fail(struct golden *g, const struct error *err)
{
    printf("%s: %s\n", g->name, err->text);
    g->failed++;
}

bool golden_has(const struct golden *g, const char *name)
{
    return st_find(g->st, name) != NULL;
}

double *golden_f64(const struct golden *g, const char *name, size_t *count)
{
    const struct st_tensor *t = st_find(g->st, name);

    if (!t)
        golden_broken(g, name);
    double *out = golden_grab(t->count, sizeof *out);
    for (size_t i = 0; i < t->count; i++) {
        const char *p = (const char *)t->data + i * st_dtype_size(t->dtype);

        union { double d; float f; int64_t l; int32_t n; uint8_t u; } v;
        memcpy(&v, p, st_dtype_size(t->dtype));
        switch (t->dtype) {
        case ST_F64: out[i] = v.d; break;
        case ST_F32: out[i] = v.f; break;
        case ST_I64: out[i] = (double)v.l; break;
        case ST_I32: out[i] = v.n; break;
        case ST_U8: out[i] = v.u; break;
        default: golden_broken(g, name);
        }
    }
    if (count)
        *count = t->count;
    return out;
}

float *golden_f32(const struct golden *g, const char *name, size_t *count)
{
    size_t n;
    double *d = golden_f64(g, name, &n);
    float *out = golden_grab(n, sizeof *out);

    for (size_t i = 0; i < n; i++)
        out[i] = (float)d[i];
    free(d);
    if (count)
        *count = n;
    return out;
}

/* ---- comparing ---------------------------------------------------------- */

void golden_check(struct golden *g, const char *name, double max_abs,
                  double relative, double tolerance)
{
    bool ok = max_abs <= tolerance;             /* a NaN fails */

    printf("%-38s %-34s abs %.2e  rel %.2e  tol %.2e  %s\n", g->name, name,
           max_abs, relative, tolerance, ok ? "ok" : "FAILED");
    g->checked++;
    g->failed += !ok;
}

/* The stored truth of an output: value k stands at index offset + k*stride. */
struct truth {
    double *v;
    size_t n, offset, stride, total;
    double atol, rtol_l2, max;
};

static bool truth_open(struct truth *t, struct golden *g, const char *name,
                       size_t n)
{
    char key[200];

    *t = (struct truth){.stride = 1};
    if (golden_has(g, name)) {
        t->v = golden_f64(g, name, &t->n);
    } else {
        snprintf(key, sizeof key, "%s.sample", name);
        t->v = golden_f64(g, key, &t->n);
        snprintf(key, sizeof key, "%s.stride", name);
        double *s = golden_f64(g, key, NULL);
        t->offset = (size_t)s[0];
        t->stride = (size_t)s[1];
        free(s);
    }
    snprintf(key, sizeof key, "%s.err", name);
    double *e = golden_f64(g, key, NULL);
    t->total = (size_t)e[0];
    t->max = e[3];
    t->atol = e[5];
    t->rtol_l2 = e[6];
    free(e);
    if (t->total == n &&
        (t->n == 0 || t->offset + (t->n - 1) * t->stride < n))
        return true;
    printf("%-38s %-34s %zu values (expected %zu)  FAILED\n", g->name, name,
           n, t->total);
    g->checked++;
    g->failed++;
    free(t->v);
    return false;
}

/* Value i of an output in either precision. */
static double golden_at(const void *x, bool is_double, size_t i)
{
    return is_double ? ((const double *)x)[i] : ((const float *)x)[i];
}

/* sum, sum of |x|, sum of squares, dot with the probe: all values, so that
 * what the sample skips is covered too. */
static void golden_statistics(struct golden *g, const char *name,
                              const float *x, size_t n)
{
    char key[200];
    double s[4] = {0}, worst = 0;

    snprintf(key, sizeof key, "%s.stats", name);
    if (!golden_has(g, key))
        return;
    uint64_t probe = random_name("probe") ^ g->seed;
    for (size_t i = 0; i < n; i++) {
        double v = x[i];

        s[0] += v;
        s[1] += fabs(v);
        s[2] += v * v;
        s[3] += v * (2 * golden_unit(probe, i) - 1);
    }
    double *want = golden_f64(g, key, NULL);
    snprintf(key, sizeof key, "%s.stats_tol", name);
    double *tol = golden_f64(g, key, NULL);
    for (int k = 0; k < 4; k++) {
        double e = fabs(s[k] - want[k]) / fmax(tol[k], 1e-300);

        if (!(e <= worst))                      /* NaN counts as worst */
            worst = e;
    }
    snprintf(key, sizeof key, "%s (statistics)", name);
    golden_check(g, key, worst, worst, 1);
    free(want);
    free(tol);
}

/* tolerance < 0 takes the file's atol. */
static void golden_test_compare(struct golden *g, const char *name,
                                const void *x, bool is_double, size_t n,
                                double tolerance, const uint8_t *skip,
                                size_t pixels)
{
    struct truth t;
    double worst = 0;

    if (!truth_open(&t, g, name, n))
        return;
    for (size_t k = 0; k < t.n; k++) {
        size_t i = t.offset + k * t.stride;
        double e = fabs(golden_at(x, is_double, i) - t.v[k]);

        if ((!skip || !skip[i % pixels]) && !(e <= worst))
            worst = e;
    }
    golden_check(g, name, worst, worst / fmax(t.max, 1e-300),
                 tolerance < 0 ? t.atol : tolerance * t.max);
    free(t.v);
}

void golden_compare(struct golden *g, const char *name, const float *x,
                    size_t n)
{
    golden_test_compare(g, name, x, false, n, -1, NULL, 1);
    golden_statistics(g, name, x, n);
}

void golden_compare_f64(struct golden *g, const char *name, const double *x,
                        size_t n, double rel)
{
    golden_test_compare(g, name, x, true, n, rel, NULL, 1);
}

void golden_compare_masked(struct golden *g, const char *name, const float *x,
                           size_t n, const uint8_t *skip, size_t pixels)
{
    golden_test_compare(g, name, x, false, n, -1, skip, pixels);
}

void golden_compare_l2(struct golden *g, const char *name, const float *x,
                       size_t n)
{
    struct truth t;
    double dd = 0, tt = 0;

    if (!truth_open(&t, g, name, n))
        return;
    for (size_t k = 0; k < t.n; k++) {
        double d = x[t.offset + k * t.stride] - t.v[k];

        dd += d * d;
        tt += t.v[k] * t.v[k];
    }
    double e = sqrt(dd) / fmax(sqrt(tt), 1e-300);
    golden_check(g, name, e, e, t.rtol_l2);
    free(t.v);
}

/* ---- weights ------------------------------------------------------------ */

static char *read_text(const char *path)
{
    size_t room = 1 << 20;
    FILE *f = fopen(path, "rb");

    if (!f) {
        fprintf(stderr, "golden: %s: cannot be read\n", path);
        exit(EX_NOINPUT);
    }
    char *text = golden_grab(room, 1);
    text[fread(text, 1, room, f)] = 0;
    fclose(f);
    return text;
}

static const cJSON *golden_member(const cJSON *j, const char *name)
{
    return cJSON_GetObjectItemCaseSensitive(j, name);
}

/* A tensor's values by its formula, or those that the case stores as
 * weight.NAME; the caller frees. */
static float *weight_values(struct golden *g, const struct golden_weight *t)
{
    char key[256];
    size_t n;

    snprintf(key, sizeof key, "weight.%s", t->name);
    if (!golden_has(g, key))
        return golden_array(t->name, g->seed, t->n, t->offset, t->bound);
    float *x = golden_f32(g, key, &n);
    if (n != t->n)
        golden_broken(g, key);
    return x;
}

/* The stored sums prove that names, seeds and bounds are read as meant. */
static void check_sums(const struct golden_weights *w, struct golden *g)
{
    size_t n;
    double *sum = golden_f64(g, "weights.sum", &n), worst = 0;

    for (size_t i = 0; i < w->count && i < n; i++) {
        float *x = weight_values(g, &w->t[i]);
        double s = 0;

        for (size_t k = 0; k < w->t[i].n; k++)
            s += x[k];
        worst = fmax(worst, fabs(s - sum[i]) / fmax(1, fabs(sum[i])));
        free(x);
    }
    golden_check(g, "weights.sum", n == w->count ? worst : INFINITY, worst,
                 1e-9);
    free(sum);
}

static void parse_weight(struct golden_weight *t, const cJSON *j)
{
    const cJSON *d = golden_member(j, "shape");

    t->name = cJSON_GetStringValue(golden_member(j, "name"));
    t->offset = cJSON_GetNumberValue(golden_member(j, "offset"));
    t->bound = cJSON_GetNumberValue(golden_member(j, "bound"));
    t->used = cJSON_IsTrue(golden_member(j, "used"));
    t->n = 1;
    for (d = d ? d->child : NULL; d && t->ndim < 5; d = d->next) {
        t->dim[t->ndim++] = (size_t)d->valuedouble;
        t->n *= (size_t)d->valuedouble;
    }
}

void golden_weights_open(struct golden_weights *w, struct golden *g,
                         const char *network)
{
    char path[4096];
    const char *slash = strrchr(g->path, '/');

    snprintf(path, sizeof path, "%.*s/%s.shapes.json",
             slash ? (int)(slash - g->path) : 1, slash ? g->path : ".",
             network ? network : golden_meta(g, "network"));
    char *text = read_text(path);
    w->json = cJSON_Parse(text);
    free(text);
    const cJSON *list = golden_member(w->json, "tensors");
    w->count = (size_t)cJSON_GetArraySize(list);
    w->t = golden_grab(w->count, sizeof *w->t);
    const cJSON *j = list ? list->child : NULL;
    for (size_t i = 0; j; j = j->next, i++)
        parse_weight(&w->t[i], j);
    if (golden_has(g, "weights.sum"))
        check_sums(w, g);
}

void golden_weights_close(struct golden_weights *w)
{
    free(w->t);
    cJSON_Delete(w->json);
}

static const struct golden_weight *golden_listed(const struct golden_weights *w,
                                                 const char *name)
{
    for (size_t i = 0; i < w->count; i++)
        if (!strcmp(w->t[i].name, name))
            return &w->t[i];
    return NULL;
}

void golden_weights_fill(struct params *ps, const struct golden_weights *w,
                         struct golden *g, const char *prefix)
{
    for (size_t i = 0; i < ps->count; i++) {
        const struct param *p = &ps->tensor[i];

        if (strncmp(p->name, prefix, strlen(prefix)))
            continue;
        const struct golden_weight *t = golden_listed(w,
                                                      p->name + strlen(prefix));
        if (!t || t->n != p->count) {
            printf("%-38s tensor %s has no formula of its size  FAILED\n",
                   g->name, p->name);
            g->checked++;
            g->failed++;
            continue;
        }
        float *x = weight_values(g, t);
        memcpy(param_w(ps, i), x, p->count * sizeof *x);
        free(x);
    }
}

/* Error of one gradient's linear statistics, in units of the tolerance
 * (tests/golden/data/README.md; a kink that float32 flips is given 1e-2). */
static double gradient_error(const double *s, const double *truth,
                             const double *f32, bool kinks)
{
    double worst = 0;

    for (int m = 0; m < 4; m++) {
        if (m == 2)                              /* not linear */
            continue;
        double slip = fabs(f32[m] - truth[m]);
        double tol = 4 * slip + 1e-5 * truth[1];
        if (kinks || slip > 1e-5 * truth[1])
            tol = fmax(tol, 1e-2 * truth[1]);
        double e = fabs(s[m] - truth[m]) / tol;
        if (!(e <= worst))
            worst = e;
    }
    return worst;
}

void golden_weights_gradients(struct golden *g, const struct params *ps,
                              const struct golden_weights *w,
                              const char *prefix)
{
    double *truth = golden_f64(g, "grad.params.stats", NULL);
    double *f32 = golden_f64(g, "grad.params.stats_f32", NULL);
    uint64_t probe = random_name("probe") ^ g->seed;
    double worst = 0;

    for (size_t i = 0; i < w->count; i++) {
        char name[256];
        double s[4] = {0};

        snprintf(name, sizeof name, "%s%s", prefix, w->t[i].name);
        size_t k = params_find(ps, name);
        if (truth[4 * i + 1] == 0)
            continue;                            /* no gradient there */
        for (size_t j = 0; k != (size_t)-1 && j < w->t[i].n; j++) {
            double v = param_g(ps, k)[j];

            s[0] += v;
            s[1] += fabs(v);
            s[3] += v * (2 * golden_unit(probe, j) - 1);
        }
        double e = gradient_error(s, truth + 4 * i, f32 + 4 * i,
                                  g->kinks);
        if (e > 1)
            printf("%-38s gradient of %s is off by %.3g tolerances\n",
                   g->name, name, e);
        if (!(e <= worst))
            worst = e;
    }
    golden_check(g, "grad.params.stats", worst, worst, 1);
    free(truth);
    free(f32);
}

/* ---- finding and running ------------------------------------------------ */

static struct {
    const char *name;
    golden_run run;
} cases[32];
static int case_count, ran, checked, failed, without_runner;

void golden_register(const char *case_name, golden_run run)
{
    if (case_count < 32) {
        cases[case_count].name = case_name;
        cases[case_count++].run = run;
    }
}

static golden_run golden_runner(const char *case_name)
{
    for (int i = 0; i < case_count; i++)
        if (!strcmp(cases[i].name, case_name))
            return cases[i].run;
    return NULL;
}

static void run_file(const char *path)
{
    struct error err = {0};
    struct golden g = {.path = path, .st = st_open(path, &err)};
    char name[256];

    if (!g.st) {
        printf("not ok %s\n", err.text);
        failed++;
        return;
    }
    golden_run run = golden_runner(golden_meta(&g, "case"));
    g.seed = strtoull(golden_meta(&g, "seed"), NULL, 0);
    snprintf(name, sizeof name, "%s/%s", golden_meta(&g, "case"),
             golden_meta(&g, "variant"));
    g.name = name;
    if (run) {
        run(&g);
        g.failed += !g.checked;
        printf("%s %s: %d checks, %d failed\n", g.failed ? "not ok" : "ok",
               g.name, g.checked, g.failed);
        ran++;
    } else {
        printf("skip %s: no runner yet\n", g.name);
        without_runner++;
    }
    fflush(stdout);
    checked += g.checked;
    failed += g.failed;
    st_close(g.st);
}

static char *found[4096];
static size_t found_count;

static int golden_visit(const char *path, const struct stat *sb, int kind,
                        struct FTW *where)
{
    size_t n = strlen(path);

    (void)sb;
    (void)where;
    if (kind == FTW_F && n > 12 && !strcmp(path + n - 12, ".safetensors") &&
        found_count < 4096)
        found[found_count++] = strdup(path);
    return 0;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "usage: golden DIR|FILE...\n");
        return EX_USAGE;
    }
    for (int i = 1; i < argc; i++)
        if (nftw(argv[i], golden_visit, 16, FTW_PHYS)) {
            fprintf(stderr, "golden: %s: cannot be read\n", argv[i]);
            return EX_NOINPUT;
        }
    qsort(found, found_count, sizeof *found, by_name);
    for (size_t i = 0; i < found_count; i++) {
        run_file(found[i]);
        free(found[i]);
    }
    printf("golden: %d files, %d checks, %d failed, %d without a runner\n",
           ran, checked, failed, without_runner);
    if (failed || !found_count)
        return 1;
    return without_runner ? 77 : 0;
}
