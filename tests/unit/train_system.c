/* The whole system's gradient: total loss of stage "all" in a tiny
 * configuration, from the motion encoder through head, means, renderer and
 * refiner to the losses.  For every tensor the derivative along its own
 * gradient is compared with a central difference.  Losses are squares and the
 * renderer has no cut-offs here; relu and the order of depths still jump, so
 * steps are chosen by how much they change the loss: few jumps lie within a
 * ten-thousandth of it.  The seed is one at which no two static Gaussians of
 * the toy change places in depth within the shortest step (at others the
 * loss jumps where it is looked at, and no step helps). */

#include "lib/lab/train/loop.h"
#include "tests/unit/train_toy.h"

#define LIMIT 0.08

static const char config[] =
    "{\"stage\":\"all\",\"seed\":12,\"batch\":1,\"micro\":1,\"pool\":2,"
    "\"targets\":2,\"image\":32,"
    "\"augment\":{\"jitter\":0,\"colour\":0,\"background\":0},"
    "\"loss\":{\"silhouette\":1,\"smooth\":true,\"adversarial\":0.5,"
    "\"landmark\":1,\"vertex\":0,\"rotation\":0,\"translation\":0,\"eye\":0},"
    "\"model\":{\"size\":64,\"plane\":16,\"mouth\":4,\"channels\":8,"
    "\"feature\":8,\"backbone\":{\"type\":\"small\",\"width\":4},"
    "\"init\":{\"width\":4},\"static\":{\"width\":8},"
    "\"dynamic\":{\"width\":8,\"head\":8,\"vertex\":4},"
    "\"mouth_decoder\":{\"width\":8},\"rgb_skip\":true,"
    "\"motion\":{\"net\":\"tf_mobilenetv3_small_minimal_100\"},"
    "\"refiner\":{\"type\":\"narrow\",\"width\":8,\"turn\":true}}}";

static double loss_of(struct task *t)
{
    double parts[TASK_PARTS] = {0}, sum = 0;
    struct error err = {0};

    memset(t->ps.g, 0, t->ps.total * sizeof *t->ps.g);
    nn_plans_update(&t->plans, true);
    if (t->type->pass(t, parts, 1, 0, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    for (int i = 0; i < t->nparts; i++)
        sum += parts[i];
    return sum;
}

/* Derivative of the loss along direction d of tensor k by differences. */
static double system_difference(struct task *t, size_t k, const float *d,
                                double e)
{
    struct param *p = &t->ps.tensor[k];
    float *w = param_w(&t->ps, k);
    float *keep = malloc(p->count * sizeof *keep);
    double f[2];

    memcpy(keep, w, p->count * sizeof *keep);
    for (int s = 0; s < 2; s++) {
        for (size_t i = 0; i < p->count; i++)
            w[i] = keep[i] + (float)(s ? e : -e) * d[i];
        f[s] = loss_of(t);
    }
    memcpy(w, keep, p->count * sizeof *keep);
    free(keep);
    return (f[1] - f[0]) / (2 * e);
}

/* The best agreement over a few steps: long ones meet jumps, short ones drown
 * in sums of floats. */
static double system_disagreement(struct task *t, size_t k, double *norm)
{
    struct param *p = &t->ps.tensor[k];
    float *d = malloc(p->count * sizeof *d);
    double best = 1e9, size = 0;

    memcpy(d, param_g(&t->ps, k), p->count * sizeof *d);
    for (size_t i = 0; i < p->count; i++)
        size += (double)d[i] * d[i];
    *norm = size = sqrt(size);
    for (size_t i = 0; size > 0 && i < p->count; i++)
        d[i] = (float)(d[i] / size);
    for (double e = 1e-2; e > 3e-6 && size > 0 && best > 0.03; e *= 0.5) {
        double fd = system_difference(t, k, d, e / size);
        best = fmin(best, fabs(fd - size) / size);
    }
    free(d);
    return size > 0 ? best : 0;
}

/* A layer that starts at zero lets no gradient through to those before it. */
static void fill_zeros(struct task *t)
{
    struct random r;

    random_init(&r, 5, "train_system");
    for (size_t k = 0; k < t->ps.count; k++) {
        const struct param *p = &t->ps.tensor[k];
        float *w = param_w(&t->ps, k), max = 0;

        for (size_t i = 0; i < p->count; i++)
            max = fmaxf(max, fabsf(w[i]));
        for (size_t i = 0; i < p->count && max == 0 && !p->frozen; i++)
            w[i] = (float)(0.05 * random_normal(&r));
    }
}

int main(void)
{
    char dir[] = "/tmp/train_system.XXXXXX", data[100], cmd[100];
    const char *files[1] = {data};
    struct train_config c;
    struct head h;
    struct task t;
    struct data_pool pool = {0};
    struct error err = {0};
    size_t bad = 0, zero = 0, checked = 0;
    double total = 0;

    if (!mkdtemp(dir))
        return 1;
    snprintf(data, sizeof data, "%s/p.spid", dir);
    toy_head(&h, 8);
    toy_stream(data, &h, 2, 3, 64);
    if (train_config_parse(&c, config, "config", &err) ||
        task_init(&t, &c, &h, &err) ||
        data_pool_init(&pool, data_open(files, 1, 0, &err), 2, 2, &err)) {
        printf("%s\n", err.text);
        return 1;
    }
    t.pool = &pool;
    fill_zeros(&t);
    loss_of(&t);
    float *g = malloc(t.ps.total * sizeof *g);
    memcpy(g, t.ps.g, t.ps.total * sizeof *g);
    for (size_t k = 0; k < t.ps.count; k++)
        if (!t.ps.tensor[k].frozen)
            for (size_t i = 0; i < t.ps.tensor[k].count; i++)
                total += pow(g[t.ps.tensor[k].offset + i], 2);
    total = sqrt(total);
    for (size_t k = 0; k < t.ps.count; k++) {
        double norm, off;
        if (t.ps.tensor[k].frozen)
            continue;
        memcpy(t.ps.g, g, t.ps.total * sizeof *g);
        off = system_disagreement(&t, k, &norm);
        checked++;
        zero += norm == 0;
        /* gradients of 1e-4 of the whole drown in float sums */
        int wrong = norm == 0 || (off > LIMIT && norm > 1e-4 * total);
        bad += wrong;
        if (wrong || k % 20 == 0)
            printf("%-52s |g| %.3g, off by %.2g%s\n", t.ps.tensor[k].name,
                   norm, off, wrong ? "  WRONG" : "");
    }
    printf("%zu tensors: %zu without gradient, %zu off by more than %g\n",
           checked, zero, bad - zero, LIMIT);
    free(g);
    data_close(pool.reader);
    data_pool_release(&pool);
    task_release(&t);
    train_config_release(&c);
    head_release(&h);
    snprintf(cmd, sizeof cmd, "rm -rf %s", dir);
    return system(cmd) || bad > 0;
}
