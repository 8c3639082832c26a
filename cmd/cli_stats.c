/* --stats: how long each stage of a program took, as TSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli.h"
#include "formats/outfile.h"
#include "lib/base/cpu.h"
#include "lib/base/list.h"
#include "lib/base/sort.h"

#define MAX_STAGES 32

static struct stage {
    const char *name;
    double *ms;                /* every call, for the median */
    size_t count, room;
} stages[MAX_STAGES];

double stats_begin(void)
{
    return cli.stats ? cpu_seconds() : 0;
}

void stats_end(const char *name, double begun)
{
    struct stage *s = stages;

    if (!cli.stats)
        return;
    while (s < stages + MAX_STAGES && s->name && strcmp(s->name, name))
        s++;
    if (s == stages + MAX_STAGES)
        return;
    s->name = name;
    double *ms = list_add(&s->ms, &s->count, &s->room, sizeof *ms, NULL);
    if (ms)
        *ms = 1e3 * (cpu_seconds() - begun);
}

/* A row for each stage, which is then forgotten. */
static void stats_print(FILE *f)
{
    fprintf(f, "stage\tcalls\ttotal_ms\tmean_ms\tmedian_ms\tp95_ms\n");
    for (struct stage *s = stages; s < stages + MAX_STAGES && s->count; s++) {
        double total = 0;

        sort_doubles(s->ms, s->count);
        for (size_t i = 0; i < s->count; i++)
            total += s->ms[i];
        fprintf(f, "%s\t%zu\t%.3f\t%.4f\t%.4f\t%.4f\n", s->name, s->count,
                total, total / (double)s->count, s->ms[s->count / 2],
                s->ms[(s->count * 95) / 100]);
        free(s->ms);
        *s = (struct stage){ 0 };
    }
}

void stats_write(void)
{
    struct outfile out;
    struct error err = { 0 };

    if (!cli.stats)
        return;
    if (!strcmp(cli.stats, "-")) {
        stats_print(stderr);
        return;
    }
    if (outfile_open(&out, cli.stats, &err))
        die_error(&err);
    stats_print(out.file);
    if (outfile_close(&out, &err))
        die_error(&err);
}
