/* A step: passes share the batch, gradients are summed, numbers that are not
 * finite are refused, Adam moves the weights.  Everything a step draws
 * follows from seed and step, so a run resumes to the byte. */
#include "lib/lab/train/loop.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/lab/train/checkpoint.h"

/* One run's working state. */
struct run {
    struct loop *l;
    struct adam adam, opponent;         /* the second of task->opponent */
    struct data_pool pool;
    float *base, *sum;      /* running statistics before the step, and their
                             * sum over its passes: laid out as ps.w */
    FILE *log, *figures;    /* log.tsv, held.tsv */
    uint64_t skipped_row;   /* bad steps in a row */
    double begun;
    uint64_t first;         /* step of this process */
};

/* The name of a file in the run's folder. */
static void loop_path(char *out, size_t size, const struct loop *l,
                      const char *name)
{
    snprintf(out, size, "%s/%s", l->folder, name);
}

/* A running statistic of batch norm. */
static bool loop_is_statistic(const struct param *p)
{
    return p->frozen && strstr(p->name, ".running_");
}

/* What loop_statistics does with every running statistic. */
enum statistics_step {
    STATISTICS_KEEP,            /* base = w, sum = 0: before the step */
    STATISTICS_RESTORE,         /* w = base: before a pass, or to undo all */
    STATISTICS_ADD,             /* sum += w: after a pass */
    STATISTICS_MEAN             /* w = sum / passes: after the step */
};

/* Batch norm's statistics move in a forward pass: every pass starts from those
 * before the step, and the step ends with their mean, so that they do not
 * depend on how passes are shared out. */
static void loop_statistics(struct run *r, enum statistics_step what,
                            double passes)
{
    struct params *ps = &r->l->task->ps;

    for (size_t k = 0; k < ps->count; k++) {
        const struct param *p = &ps->tensor[k];
        float *w = ps->w + p->offset, *b = r->base + p->offset;
        float *s = r->sum + p->offset;

        if (!loop_is_statistic(p))
            continue;
        for (size_t i = 0; i < p->count; i++) {
            switch (what) {
            case STATISTICS_KEEP:
                b[i] = w[i];
                s[i] = 0;
                break;
            case STATISTICS_RESTORE:
                w[i] = b[i];
                break;
            case STATISTICS_ADD:
                s[i] += w[i];
                break;
            case STATISTICS_MEAN:
                w[i] = (float)(s[i] / passes);
                break;
            }
        }
    }
}

/* ---- files -------------------------------------------------------------- */

/* A log, fresh or to go on with. */
static FILE *loop_open_log(const struct loop *l, const char *name, bool fresh,
                           struct error *err)
{
    char path[TRAIN_PATH];
    FILE *f;

    loop_path(path, sizeof path, l, name);
    f = fopen(path, fresh ? "w" : "a");
    if (!f)
        error_set(err, EX_CANTCREAT, "%s: %s", path, strerror(errno));
    return f;
}

/* Both logs, with their column names when fresh; rank 0 alone writes. */
static int loop_open_logs(struct run *r, struct error *err)
{
    const struct task *t = r->l->task;
    bool fresh = r->l->step == 0;

    if (r->l->group->rank)
        return 0;
    r->log = loop_open_log(r->l, "log.tsv", fresh, err);
    r->figures = r->log ? loop_open_log(r->l, "held.tsv", fresh, err) : NULL;
    if (!r->figures)
        return -1;
    if (!fresh)
        return 0;
    fprintf(r->log, "step\tloss");
    for (int i = 0; i < t->nparts + t->nwatched; i++)
        fprintf(r->log, "\t%s", t->part_name[i]);
    fprintf(r->log, "\tnorm\trate\tseconds\n");
    fprintf(r->figures, "step");
    for (int i = 0; i < t->nfigures; i++)
        fprintf(r->figures, "\t%s", t->figure_name[i]);
    fprintf(r->figures, "\n");
    return 0;
}

/* Exchange the weights and their average. */
static void loop_swap_average(struct run *r)
{
    float *w = r->l->task->ps.w;

    if (r->adam.average) {
        r->l->task->ps.w = r->adam.average;
        r->adam.average = w;
    }
}

/* The run as its checkpoint has it. */
static struct checkpoint loop_state(struct run *r)
{
    struct loop *l = r->l;
    struct params *opponent = l->task->opponent;
    struct checkpoint c = {
        .model = {&l->task->ps, &r->adam},
        .opponent = {opponent, opponent ? &r->opponent : NULL},
        .step = l->step, .skipped = l->skipped};

    checkpoint_fingerprint(c.fingerprint, l->config, &l->task->ps, opponent);
    return c;
}

/* The checkpoint, and the averaged weights as a model. */
static int loop_save(struct run *r, struct error *err)
{
    struct loop *l = r->l;
    char path[TRAIN_PATH];
    const char *meta[] = {"spid-stage", train_stage_name(l->config->stage),
                          NULL};
    const struct checkpoint state = loop_state(r);
    int rc;

    if (l->group->rank)
        return 0;
    loop_path(path, sizeof path, l, "checkpoint.safetensors");
    if (checkpoint_save(path, &state, err))
        return -1;
    loop_path(path, sizeof path, l, "model.safetensors");
    loop_swap_average(r);
    rc = params_save(&l->task->ps, path, meta, err);
    loop_swap_average(r);
    return rc;
}

/* The averaged weights, for what judges them: networks planned for training
 * move their running statistics then, too. */
static void loop_begin_judging(struct run *r)
{
    loop_swap_average(r);
    loop_statistics(r, STATISTICS_KEEP, 0);
    nn_plans_update(&r->l->task->plans, true);
}

/* The weights that learn again. */
static void loop_end_judging(struct run *r)
{
    loop_statistics(r, STATISTICS_RESTORE, 0);
    loop_swap_average(r);
    nn_plans_update(&r->l->task->plans, true);
}

/* Figures of the averaged weights on people never trained on. */
static int loop_validate(struct run *r, struct error *err)
{
    struct loop *l = r->l;
    int rc;

    if (l->group->rank || !l->task->nvalidation)
        return 0;
    loop_begin_judging(r);
    rc = l->task->type->validate(l->task, l->figures, err);
    loop_end_judging(r);
    if (rc)
        return -1;
    fprintf(r->figures, "%" PRIu64, l->step);
    for (int i = 0; i < l->task->nfigures; i++)
        fprintf(r->figures, "\t%.5g", l->figures[i]);
    fprintf(r->figures, "\n");
    fflush(r->figures);
    return 0;
}

/* A contact sheet of the averaged weights. */
static int loop_draw_sheet(struct run *r, struct error *err)
{
    struct loop *l = r->l;
    char path[TRAIN_PATH], name[40];
    struct contact_sheet sh = {0};
    int rc;

    if (l->group->rank || !l->task->nvalidation)
        return 0;
    snprintf(name, sizeof name, "sheet-%06" PRIu64 ".png", l->step);
    loop_path(path, sizeof path, l, name);
    loop_begin_judging(r);
    rc = l->task->type->sheet(l->task, &sh, err);
    loop_end_judging(r);
    if (!rc)
        return contact_sheet_save(&sh, path, err);
    contact_sheet_release(&sh);
    return rc;
}

/* ---- a step ------------------------------------------------------------- */

/* What processes exchange: gradients of what learns, or running statistics. */
static bool loop_is_shared(const struct param *p, bool statistics)
{
    return statistics ? loop_is_statistic(p) : !p->frozen;
}

/* x, laid out as the weights = its sum over the processes, where a tensor is
 * shared; neighbours go in one message. */
static int loop_sum(struct run *r, float *x, bool statistics,
                    struct error *err)
{
    const struct params *ps = &r->l->task->ps;

    for (size_t k = 0, end; k < ps->count; k = end) {
        const struct param *t = ps->tensor;

        end = k + 1;
        if (!loop_is_shared(&t[k], statistics))
            continue;
        while (end < ps->count && loop_is_shared(&t[end], statistics))
            end++;
        size_t n = t[end - 1].offset + t[end - 1].count - t[k].offset;
        if (group_sum(r->l->group, x + t[k].offset, n, err))
            return -1;
        r->l->cost.sum_bytes += n * sizeof *x;
    }
    return 0;
}

/* The opponent's gradients likewise; none of its tensors is frozen. */
static int loop_sum_opponent(struct run *r, struct error *err)
{
    const struct params *ps = r->l->task->opponent;

    if (!ps)
        return 0;
    r->l->cost.sum_bytes += ps->total * sizeof *ps->g;
    return group_sum(r->l->group, ps->g, ps->total, err);
}

/* Losses and gradients of the whole batch, over all processes. */
static int loop_gather(struct run *r, double *parts, struct error *err)
{
    struct loop *l = r->l;
    struct params *ps = &l->task->ps, *opponent = l->task->opponent;
    size_t passes = (size_t)(l->config->batch / l->config->micro);
    double begun = cpu_seconds();

    memset(ps->g, 0, ps->total * sizeof *ps->g);
    if (opponent)
        memset(opponent->g, 0, opponent->total * sizeof *opponent->g);
    memset(parts, 0, TASK_PARTS * sizeof *parts);
    loop_statistics(r, STATISTICS_KEEP, 0);
    for (size_t k = 0; k < passes; k++) {
        if (k % (size_t)l->group->size != (size_t)l->group->rank)
            continue;
        loop_statistics(r, STATISTICS_RESTORE, 0);
        if (l->task->type->pass(l->task, parts, l->step, k, err))
            return -1;
        loop_statistics(r, STATISTICS_ADD, 0);
        l->cost.passes++;
    }
    double summed = cpu_seconds();
    l->cost.pass_seconds += summed - begun;
    l->cost.sum_bytes = 0;
    if (loop_sum(r, ps->g, false, err) || loop_sum(r, r->sum, true, err) ||
        loop_sum_opponent(r, err) ||
        group_sum_double(l->group, parts, TASK_PARTS, err))
        return -1;
    l->cost.sum_seconds += cpu_seconds() - summed;
    loop_statistics(r, STATISTICS_MEAN, (double)passes);
    return 0;
}

/* A step whose numbers are not finite is undone; too many end the run. */
static int loop_skip(struct run *r, const char *what, const char *name,
                     struct error *err)
{
    struct loop *l = r->l;
    char text[200];

    loop_statistics(r, STATISTICS_RESTORE, 0);
    l->skipped++;
    snprintf(text, sizeof text, "step %" PRIu64 ": %s %s is not finite; the "
             "step is skipped", l->step, what, name);
    if (l->warn && !l->group->rank)
        l->warn(text);
    if (++r->skipped_row >= LOOP_MAX_BAD)
        return error_set(err, EX_SOFTWARE, "%s, the %dth in a row", text,
                         LOOP_MAX_BAD);
    return 0;
}

/* The name of the first tensor whose gradient is not finite. */
static const char *loop_bad_name(const struct params *ps)
{
    const size_t bad = adam_first_bad(ps);

    return bad < ps->count ? ps->tensor[bad].name : "all";
}

/* Losses and gradients of a batch, then the update. */
static int loop_step(struct run *r, double *parts, double *loss, double *norm,
                     struct error *err)
{
    struct loop *l = r->l;
    struct params *ps = &l->task->ps, *opponent = l->task->opponent;
    double against = 0;

    if (loop_gather(r, parts, err))
        return -1;
    *loss = 0;
    for (int i = 0; i < l->task->nparts; i++)
        *loss += parts[i];
    *norm = adam_norm(ps);
    if (!isfinite(*norm))
        return loop_skip(r, "gradient of", loop_bad_name(ps), err);
    if (opponent && !isfinite(against = adam_norm(opponent)))
        return loop_skip(r, "gradient of", loop_bad_name(opponent), err);
    if (!isfinite(*loss))
        return loop_skip(r, "the", "loss", err);
    r->skipped_row = 0;
    adam_update(&r->adam, ps, train_rate(l->config, l->step), *norm);
    if (opponent && l->step >= l->task->opponent_from)
        adam_update(&r->opponent, opponent, l->task->opponent_rate, against);
    nn_plans_update(&l->task->plans, false);
    return 0;
}

/* A line of log.tsv, and the program's report. */
static void loop_write_log(struct run *r, const double *parts, double loss,
                           double norm)
{
    struct loop *l = r->l;
    double now = cpu_seconds() - r->begun;
    double done = (double)(l->step - r->first + 1);
    struct loop_report rep = {
        .step = l->step, .steps = (uint64_t)l->config->steps, .loss = loss,
        .norm = norm, .rate = train_rate(l->config, l->step),
        .seconds = now, .parts = parts, .task = l->task,
        .items_per_second = done * (double)l->config->batch / now,
        .left = ((double)l->config->steps - (double)l->step - 1) * now / done,
    };

    if (l->group->rank)
        return;
    if (l->report)
        l->report(&rep);
    if (l->step % (uint64_t)l->config->log_every)
        return;
    fprintf(r->log, "%" PRIu64 "\t%.9g", l->step, loss);
    for (int i = 0; i < l->task->nparts + l->task->nwatched; i++)
        fprintf(r->log, "\t%.6g", parts[i]);
    fprintf(r->log, "\t%.5g\t%.4g\t%.2f\n", norm, rep.rate, now);
    fflush(r->log);
}

/* Every so many steps; 0 never. */
static bool loop_due(int64_t every, uint64_t at)
{
    return every > 0 && at % (uint64_t)every == 0;
}

/* Steps until the last one or a signal. */
static int loop_steps(struct run *r, struct error *err)
{
    struct loop *l = r->l;
    const struct train_config *c = l->config;
    double parts[TASK_PARTS], loss = 0, norm = 0;

    while (l->step < (uint64_t)c->steps) {
        uint64_t want = (uint64_t)c->pool +
                        (uint64_t)((double)l->step * c->people_per_step);
        bool stop = l->stop && *l->stop;

        if (group_any(l->group, &stop, err))
            return -1;
        if (stop)
            break;
        double begun = cpu_seconds();
        if (data_pool_advance(&r->pool, want, err) ||
            loop_step(r, parts, &loss, &norm, err))
            return -1;
        l->cost.seconds += cpu_seconds() - begun;
        l->cost.steps++;
        loop_write_log(r, parts, loss, norm);
        l->step++;
        if (loop_due(c->validation_every, l->step) && loop_validate(r, err))
            return -1;
        if (loop_due(c->sheet_every, l->step) && loop_draw_sheet(r, err))
            return -1;
        if (loop_due(c->checkpoint_every, l->step) && loop_save(r, err))
            return -1;
    }
    return 0;
}

/* ---- the run ------------------------------------------------------------ */

/* What moves the weights; what of the opponent's moves has little memory, for
 * what it learns against changes (Radford et al. 2016). */
static int loop_start_adam(struct run *r, struct error *err)
{
    const struct train_config *c = r->l->config;
    const struct params *opponent = r->l->task->opponent;

    if (adam_init(&r->adam, &r->l->task->ps, (float)c->clip,
                  (float)c->average, err) ||
        (opponent && adam_init(&r->opponent, opponent, 0, 0, err)))
        return -1;
    r->opponent.beta1 = 0.5f;
    return 0;
}

/* The checkpoint, where there is one. */
static int loop_resume(struct run *r, struct error *err)
{
    struct checkpoint state = loop_state(r);
    char path[TRAIN_PATH];

    loop_path(path, sizeof path, r->l, "checkpoint.safetensors");
    if (checkpoint_load(path, &state, err) < 0)
        return -1;
    r->l->step = state.step;
    r->l->skipped = state.skipped;
    return 0;
}

/* Folder, weights, checkpoint, pool and logs. */
static int loop_start(struct run *r, struct error *err)
{
    struct loop *l = r->l;
    struct params *ps = &l->task->ps;
    uint64_t people;

    if (mkdir(l->folder, 0777) && errno != EEXIST)
        return error_set(err, EX_CANTCREAT, "%s: %s", l->folder,
                         strerror(errno));
    for (size_t i = 0; i < l->ninit; i++)
        if (checkpoint_import(ps, &l->init[i], err))
            return -1;
    if (loop_start_adam(r, err) || loop_resume(r, err))
        return -1;
    nn_plans_update(&l->task->plans, true);
    people = (uint64_t)l->config->pool;
    if (l->step)
        people += (uint64_t)((double)(l->step - 1) *
                             l->config->people_per_step);
    if (data_pool_init(&r->pool, l->reader, (size_t)l->config->pool, people,
                       err))
        return -1;
    l->task->pool = &r->pool;
    r->base = calloc(ps->total + 1, sizeof *r->base);
    r->sum = calloc(ps->total + 1, sizeof *r->sum);
    if (!r->base || !r->sum)
        return error_set(err, EX_OSERR, "out of memory");
    return loop_open_logs(r, err);
}

int loop_run(struct loop *l, struct error *err)
{
    struct run r = {.l = l};
    int rc = loop_start(&r, err);

    r.begun = cpu_seconds();
    r.first = l->step;
    if (!rc && l->step == 0)
        rc = loop_draw_sheet(&r, err);
    if (!rc)
        rc = loop_steps(&r, err);
    if (!rc && (rc = loop_save(&r, err)) == 0 && l->step > r.first) {
        rc = loop_validate(&r, err);
        if (!rc && l->step == (uint64_t)l->config->steps)
            rc = loop_draw_sheet(&r, err);
    }
    if (r.log)
        fclose(r.log);
    if (r.figures)
        fclose(r.figures);
    data_pool_release(&r.pool);
    adam_release(&r.adam);
    adam_release(&r.opponent);
    free(r.base);
    free(r.sum);
    return rc;
}
