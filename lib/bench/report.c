#include "lib/bench/bench.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"

static void put_error(FILE *f, const struct bench_row *r)
{
    if (isnan(r->psnr_db))
        fprintf(f, "%10s %8s  %s\n", "-", "-", r->pareto ? "*" : "");
    else
        fprintf(f, "%10.2e %8.1f  %s\n", r->max_abs, r->psnr_db,
                r->pareto ? "*" : "");
}

char *bench_table(const struct bench *b)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);

    if (!f)
        return NULL;
    fprintf(f, "%s, %s\n", cpu_name(), cpu_level_name(cpu_level()));
    fprintf(f, "%-8s %-30s %-26s %3s %9s %9s %9s %10s %8s  %s\n", "stage",
            "config", "knob", "thr", "ms min", "median", "p95", "max abs",
            "PSNR dB", "Pareto");
    for (size_t i = 0; i < b->rows; i++) {
        const struct bench_row *r = &b->row[i];

        fprintf(f, "%-8s %-30s %-26s %3d %9.3f %9.3f %9.3f ", r->stage,
                r->config, r->knob, r->threads, r->ms_min, r->ms_median,
                r->ms_p95);
        put_error(f, r);
    }
    for (size_t i = 0; i < b->pairs; i++)
        fprintf(f, "%s %s: %.3f\n", b->pair[i].object, b->pair[i].key,
                b->pair[i].value);
    if (b->notes)
        fputs(b->notes, f);
    if (fclose(f)) {
        free(text);
        return NULL;
    }
    return text;
}

/* JSON has no NaN and no infinity. */
static void add_number(cJSON *o, const char *key, double v)
{
    if (isfinite(v))
        cJSON_AddNumberToObject(o, key, v);
    else
        cJSON_AddNullToObject(o, key);
}

static void add_row(cJSON *rows, const struct bench_row *r)
{
    cJSON *o = cJSON_CreateObject();

    cJSON_AddStringToObject(o, "stage", r->stage);
    cJSON_AddStringToObject(o, "config", r->config);
    cJSON_AddStringToObject(o, "knob", r->knob);
    cJSON_AddNumberToObject(o, "threads", r->threads);
    add_number(o, "ms_min", r->ms_min);
    add_number(o, "ms_median", r->ms_median);
    add_number(o, "ms_p95", r->ms_p95);
    add_number(o, "max_abs", r->max_abs);
    add_number(o, "psnr_db", r->psnr_db);
    cJSON_AddBoolToObject(o, "pareto", r->pareto);
    cJSON_AddItemToArray(rows, o);
}

char *bench_json(const struct bench *b)
{
    cJSON *root = cJSON_CreateObject();
    cJSON *machine = cJSON_AddObjectToObject(root, "machine");

    cJSON_AddStringToObject(machine, "cpu", cpu_name());
    cJSON_AddStringToObject(machine, "isa", cpu_level_name(cpu_level()));
    cJSON_AddNumberToObject(machine, "threads", b->threads);
    cJSON *rows = cJSON_AddArrayToObject(root, "rows");

    for (size_t i = 0; i < b->rows; i++)
        add_row(rows, &b->row[i]);
    for (size_t i = 0; i < b->pairs; i++) {
        const struct bench_pair *p = &b->pair[i];
        cJSON *o = cJSON_GetObjectItemCaseSensitive(root, p->object);

        add_number(o ? o : cJSON_AddObjectToObject(root, p->object), p->key,
                   p->value);
    }
    char *text = cJSON_Print(root);

    cJSON_Delete(root);
    return text;
}
