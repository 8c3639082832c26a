/* Medians of every stage's milliseconds. */
#include "lib/animate/report.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/list.h"
#include "lib/base/sort.h"

/* Stages in the order of the pipeline; the paper's figure in ms on an A100, 0
 * where it gives none.  Its motion encoder and heads are one number. */
static const struct {
    const char *name;
    double paper;
} stage[REPORT_STAGES] = {
    {"decode", 0}, {"crop", 0.2}, {"encoder", 2.1}, {"heads", 0},
    {"mesh", 1.3}, {"update", 0}, {"render", 1.5}, {"refine", 0},
    {"encode", 0}
};

/* A frame's seconds in the order of the pipeline. */
static void report_stage_times(double t[REPORT_STAGES],
                               const struct animate_times *a)
{
    const double in_order[REPORT_STAGES] = {
        a->decode, a->crop, a->network, a->heads, a->draw.flame,
        a->draw.branches, a->draw.splat, a->draw.refine, a->encode
    };

    memcpy(t, in_order, sizeof in_order);
}

void animate_report_frame(struct animate_report *r,
                          const struct animate_frame *f)
{
    double t[REPORT_STAGES];
    struct list_column all[REPORT_STAGES + 1] = {
        {&r->latency, sizeof *r->latency}};

    for (int i = 0; i < REPORT_STAGES; i++)
        all[i + 1] = (struct list_column){&r->ms[i], sizeof *r->ms[i]};
    if (list_grow_columns(all, REPORT_STAGES + 1, &r->room, r->frames))
        return;
    report_stage_times(t, &f->t);
    for (int i = 0; i < REPORT_STAGES; i++)
        r->ms[i][r->frames] = (float)(1e3 * t[i]);
    r->latency[r->frames] = (float)(1e3 * f->latency);
    r->lost += f->track->lost;
    r->ended = cpu_seconds();
    if (r->frames++ == 0)
        r->begun = r->ended;
}

void animate_report_times(double (*begin)(void),
                          void (*end)(const char *stage, double begun),
                          const struct animate_frame *f)
{
    double t[REPORT_STAGES];

    report_stage_times(t, &f->t);
    for (int i = 0; i < REPORT_STAGES; i++)
        end(stage[i].name, begin() - t[i]);
}

/* Of n values, which are sorted. */
static double report_quantile(float *x, size_t n, double q)
{
    sort_floats(x, n);
    return n ? (double)x[(size_t)(q * (double)(n - 1) + 0.5)] : 0;
}

/* The table of medians. */
static void report_print_stages(FILE *to, struct animate_report *r,
                                const struct prepared *s)
{
    double sum = 0;

    fprintf(to, "  Phase A: crop, shape, motion, matte %.0f ms; branches "
            "%.0f ms, %zu Gaussians\n", 1e3 * s->shape_s, 1e3 * s->bake_s,
            s->baked.N);
    fprintf(to, "  %-10s %9s %9s %12s\n", "stage", "median", "p95",
            "paper, A100");
    for (int i = 0; i < REPORT_STAGES; i++) {
        double median = report_quantile(r->ms[i], r->frames, 0.5);

        fprintf(to, "  %-10s %9.3f %9.3f", stage[i].name, median,
                report_quantile(r->ms[i], r->frames, 0.95));
        if (stage[i].paper > 0)
            fprintf(to, " %12.1f", stage[i].paper);
        fputc('\n', to);
        sum += i == 0 || i == REPORT_STAGES - 1 ? 0 : median;
    }
    fprintf(to, "  driving pipeline, one core after the other: %.3f ms "
            "(paper 6.1 ms without refiner)\n", sum);
}

void animate_report_print(FILE *to, struct animate_report *r,
                          const struct prepared *s, bool stages, bool live)
{
    double seconds = r->ended - r->begun;

    fprintf(to, "%s: %zu frame%s, %.1f a second",
            r->program ? r->program : "spid-animate", r->frames,
            plural(r->frames),
            r->frames > 1 && seconds > 0
                ? (double)(r->frames - 1) / seconds : 0.0);
    if (r->lost)
        fprintf(to, ", %zu without a face", r->lost);
    if (live)
        fprintf(to, ", %zu dropped; latency p50 %.1f ms, p95 %.1f ms",
                r->dropped, report_quantile(r->latency, r->frames, 0.5),
                report_quantile(r->latency, r->frames, 0.95));
    fputc('\n', to);
    if (stages)
        report_print_stages(to, r, s);
}

void animate_report_release(struct animate_report *r)
{
    for (int i = 0; i < REPORT_STAGES; i++)
        free(r->ms[i]);
    free(r->latency);
    memset(r, 0, sizeof *r);
}
