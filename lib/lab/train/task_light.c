/* The light network alone: people of scans, whose light is known. */
#include <math.h>

#include "lib/lab/train/encoder_task.h"
#include "lib/lab/train/task.h"
#include "lib/net/light_net.h"

#define N LIGHT_NET_SIDE

enum { FIGURE_ERROR, FIGURE_NULL, FIGURE_COUNT };
static const char *const figure_name[FIGURE_COUNT] = {
    "light_rms", "unlit_rms"
};

struct impl {
    struct encoder_task e;
    struct light_net net;
};

/* People without a known light teach nothing. */
static int light_task_pass(struct task *t, double *parts, uint64_t step,
                           size_t micro, struct error *err)
{
    struct impl *m = t->impl;

    if (encoder_task_draw(&m->e, t, step, micro, err))
        return -1;
    for (size_t i = 0; i < m->e.batch; i++) {
        const struct motion *truth = &m->e.item[i].frame->motion;

        if (truth->lit)
            parts[0] += light_net_loss(truth->light, m->e.rgb + i * N * N * 3,
                                       1 / (double)t->config->batch,
                                       &m->net);
    }
    return 0;
}

/* Root mean square distance of l from truth, and of 0. */
static int light_task_validate(struct task *t, double *figures,
                               struct error *err)
{
    struct impl *m = t->impl;
    double sum[FIGURE_COUNT] = {0};
    size_t n = 0;

    for (size_t i = 0; i < t->nvalidation; i++)
        for (size_t k = 0; k < t->validation[i].count; k++) {
            const struct data_frame *f = &t->validation[i].frame[k];
            float l[3];

            if (!f->motion.lit)
                continue;
            if (data_crop((void *)f, m->e.rgb, f->crop, err))
                return -1;
            light_net_forward(l, m->e.rgb, &m->net);
            for (int c = 0; c < 3; c++) {
                const double truth = (double)f->motion.light[c];
                const double off = (double)l[c] - truth;

                sum[FIGURE_ERROR] += off * off;
                sum[FIGURE_NULL] += truth * truth;
            }
            n++;
        }
    for (int k = 0; k < FIGURE_COUNT; k++)
        figures[k] = sqrt(sum[k] / (double)(n + !n));
    return 0;
}

static int light_task_init(struct task *t, struct error *err)
{
    struct impl *m = t->impl;

    light_net_init(&m->net, &t->ps);
    return encoder_task_fill(t, err) ||
           encoder_task_init(&m->e, t, 3, err) ? -1 : 0;
}

static const char *const light_task_part[] = {"light"};
const struct task_type light_task = {
    sizeof(struct impl), 0, 1, FIGURE_COUNT, light_task_part, figure_name,
    light_task_init, NULL, light_task_pass,
    light_task_validate, encoder_task_sheet
};
