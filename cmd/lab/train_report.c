/* Lines about a run of training. */
#include "cmd/lab/train_report.h"

#include <stdio.h>
#include <sys/resource.h>

#include "cmd/cli.h"

void train_report_run(const struct task *t)
{
    const struct train_config *c = t->config;
    size_t learning = 0;

    for (size_t i = 0; i < t->ps.count; i++)
        learning += t->ps.tensor[i].frozen ? 0 : t->ps.tensor[i].count;
    notice("stage %s, %zu weights learn, batch %lld",
           train_stage_name(c->stage), learning, (long long)c->batch);
    if (c->stage >= STAGE_AVATAR && !*c->perceptual_file)
        notice("no perceptual network is given: a Laplacian pyramid stands in "
               "for L_perc");
    if (c->stage == STAGE_MOTION ||
        (c->stage == STAGE_ALL && !*c->alignment_file))
        notice("no alignment network is given: projected landmarks stand in "
               "for L_lmk");
}

void train_report_step(const struct loop_report *r)
{
    char note[300];
    int at = snprintf(note, sizeof note, "loss %.4f", r->loss);
    long left = (long)r->left;

    for (int i = 0; i < r->task->nparts && at < 200; i++)
        at += snprintf(note + at, sizeof note - (size_t)at, " %.4s %.3f",
                       r->task->part_name[i], r->parts[i]);
    snprintf(note + at, sizeof note - (size_t)at,
             " %.1f items/s, %ld:%02ld:%02ld left", r->items_per_second,
             left / 3600, left / 60 % 60, left % 60);
    progress(train_stage_name(r->task->config->stage), (size_t)r->step + 1,
             (size_t)r->steps, note);
}

void train_report_warning(const char *text)
{
    warn("%s", text);
}

void train_report_cost(const struct loop_cost *c)
{
    double steps = (double)c->steps, passes = (double)c->passes;
    struct rusage use;

    if (!c->steps || getrusage(RUSAGE_SELF, &use))
        return;
    notice("%.0f steps, %.2f s a step (%.1f passes of %.2f s, %.1f MB summed "
           "in %.2f s), at most %.2f GB", steps, c->seconds / steps,
           passes / steps, passes > 0 ? c->pass_seconds / passes : 0,
           (double)c->sum_bytes / 1e6, c->sum_seconds / steps,
           (double)use.ru_maxrss / 1e6);
}
