/* Repeated calls, their quantiles, rows and the Pareto front. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/list.h"
#include "lib/base/sort.h"

void bench_init(struct bench *b)
{
    memset(b, 0, sizeof *b);
    b->seconds = 20;
    b->threads = 1;
}

void bench_release(struct bench *b)
{
    free(b->row);
    free(b->pair);
    free(b->notes);
    memset(b, 0, sizeof *b);
}

struct bench_times bench_quantiles(double *ms, size_t n)
{
    sort_doubles(ms, n);
    return (struct bench_times){n, ms[0], ms[n / 2], ms[n * 95 / 100]};
}

int bench_time(struct bench_times *t, double seconds, size_t min,
               int (*call)(void *context, struct error *err), void *context,
               struct error *err)
{
    enum { MAX = 4096 };
    double *ms = malloc(MAX * sizeof *ms), begun = cpu_seconds();
    size_t runs = 0;
    int rc = -1;

    if (!ms)
        return error_set(err, EX_OSERR, "out of memory");
    if (call(context, err))
        goto out;
    while (runs < MAX && (runs < min || cpu_seconds() - begun < seconds)) {
        double start = cpu_seconds();

        if (call(context, err))
            goto out;
        ms[runs++] = (cpu_seconds() - start) * 1e3;
    }
    *t = bench_quantiles(ms, runs);
    rc = 0;
out:
    free(ms);
    return rc;
}

struct bench_row *bench_add(struct bench *b, const char *stage,
                            const char *config, const char *knob, int threads,
                            const struct bench_times *t, double max_abs,
                            double psnr_db)
{
    struct bench_row *row = list_add(&b->row, &b->rows, &b->row_room,
                                     sizeof *row, NULL);

    if (!row)
        return NULL;
    snprintf(row->stage, sizeof row->stage, "%s", stage);
    snprintf(row->config, sizeof row->config, "%s", config);
    snprintf(row->knob, sizeof row->knob, "%s", knob);
    row->threads = threads;
    row->ms_min = t->min;
    row->ms_median = t->median;
    row->ms_p95 = t->p95;
    row->max_abs = max_abs;
    row->psnr_db = psnr_db;
    return row;
}

bool bench_same_group(const struct bench_row *a, const struct bench_row *b)
{
    return !strcmp(a->stage, b->stage) && !strcmp(a->config, b->config) &&
           a->threads == b->threads;
}

void bench_pareto(struct bench *b, size_t first)
{
    for (size_t i = first; i < b->rows; i++) {
        struct bench_row *r = &b->row[i];

        r->pareto = !isnan(r->psnr_db);
        for (size_t k = first; k < b->rows && r->pareto; k++) {
            const struct bench_row *o = &b->row[k];

            if (k != i && bench_same_group(o, r) && o->ms_min <= r->ms_min &&
                o->psnr_db >= r->psnr_db &&
                (o->ms_min < r->ms_min || o->psnr_db > r->psnr_db))
                r->pareto = false;
        }
    }
}

void bench_note(struct bench *b, const char *format, ...)
{
    char line[512];
    va_list ap;

    va_start(ap, format);
    vsnprintf(line, sizeof line, format, ap);
    va_end(ap);
    size_t n = strlen(line);
    char *notes = realloc(b->notes, b->notes_length + n + 2);

    if (!notes)
        return;
    memcpy(notes + b->notes_length, line, n);
    memcpy(notes + b->notes_length + n, "\n", 2);
    b->notes = notes;
    b->notes_length += n + 1;
}

void bench_number(struct bench *b, const char *object, const char *key,
                  double value)
{
    struct bench_pair *p = b->pair;

    for (size_t i = 0; i < b->pairs; i++, p++)
        if (!strcmp(p->object, object) && !strcmp(p->key, key)) {
            p->value = value;
            return;
        }
    p = list_add(&b->pair, &b->pairs, &b->pair_room, sizeof *p, NULL);
    if (!p)
        return;
    snprintf(p->object, sizeof p->object, "%s", object);
    snprintf(p->key, sizeof p->key, "%s", key);
    p->value = value;
}

void bench_compare(double *max_abs, double *psnr_db, const float *x,
                   const double *truth, size_t n)
{
    double worst = 0, sum = 0;

    for (size_t i = 0; i < n; i++) {
        double d = fabs(x[i] - truth[i]);

        if (!(d <= worst))             /* a NaN is the worst */
            worst = d;
        sum += d * d;
    }
    *max_abs = worst;
    *psnr_db = -10 * log10(fmax(sum / (double)n, 1e-300));
}
