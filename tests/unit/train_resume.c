/* A run that stops and goes on ends in the same bytes as one that does not;
 * running statistics move in training, and stay with running_norm;
 * the motion loss's gradient agrees with central differences; a gradient that
 * is not finite is named and its step skipped. */
#include <sysexits.h>

#include "lib/net/motion_encoder.h"
#include "lib/lab/train/loop.h"
#include "tests/check.h"
#include "tests/unit/train_toy.h"

static char folder[] = "/tmp/train_resume.XXXXXX";
static int warnings;
static char warned[300];

static void on_warn(const char *text)
{
    warnings++;
    snprintf(warned, sizeof warned, "%s", text);
}

/* Train for `steps` in the subfolder; 0 or -1. */
static int resume_run(const char *sub, const char *data, const struct head *h,
                      int steps, struct train_config *c, struct error *err)
{
    char path[200];
    struct task task;
    struct group group = {0, 1};
    struct loop loop = {.config = c, .task = &task, .group = &group,
                        .folder = path, .warn = on_warn};
    int rc = -1;

    snprintf(path, sizeof path, "%s/%s", folder, sub);
    c->steps = steps;
    if (!task_init(&task, c, h, err)) {
        loop.reader = data_open(&data, 1, task.type->margin, err);
        if (loop.reader)
            rc = loop_run(&loop, err);
    }
    data_close(loop.reader);
    task_release(&task);
    return rc;
}

static int same_file(const char *a, const char *b)
{
    char cmd[500];

    snprintf(cmd, sizeof cmd, "cmp -s %s/%s/checkpoint.safetensors "
             "%s/%s/checkpoint.safetensors", folder, a, folder, b);
    return system(cmd) == 0;
}

static const char config[] =
    "{\"stage\":\"motion\",\"seed\":7,\"batch\":4,\"micro\":2,\"rate\":1e-3,"
    "\"pool\":3,\"people_per_step\":0.6,\"checkpoint_every\":100,"
    "\"loss\":{\"exp\":1,\"square_landmarks\":false}}";

static void check_resume(const struct head *h, const char *data)
{
    struct train_config c;
    struct error err = {0};
    int rc;

    if (train_config_parse(&c, config, "config", &err))
        exit(1);
    /* The learning rate's schedule depends on steps only when it falls. */
    rc = resume_run("whole", data, h, 5, &c, &err) ||
         resume_run("parts", data, h, 2, &c, &err) ||
         resume_run("parts", data, h, 3, &c, &err) ||
         resume_run("parts", data, h, 5, &c, &err);
    if (rc)
        printf("%s\n", err.text);
    expect("runs end well", rc, 0, 0);
    expect("5 steps = 2 + 1 + 2 steps, to the bit",
           same_file("whole", "parts"), 1, 0);
    c.seed = 8;
    rc = resume_run("parts", data, h, 6, &c, &err);
    printf("%s\n", err.text);
    expect("another seed's checkpoint is refused", err.code, EX_CONFIG, 0);
    train_config_release(&c);
}

/* ---- running statistics -------------------------------------------------- */

/* The largest running mean of the network in a folder; how far its first
 * layer is from another folder's. */
static double largest_mean(const char *sub, const char *other, double *far)
{
    static const char mean[] = "motion.encoder.bn1.running_mean";
    static const char layer[] = "motion.encoder.conv_stem.weight";
    const char *folders[2] = {sub, other};
    float *w[2];
    struct error err = {0};
    size_t n, dims[4] = {0};
    double max = 0;

    *far = 0;
    for (int k = 0; k < 2; k++) {
        char path[200];
        snprintf(path, sizeof path, "%s/%s/model.safetensors", folder,
                 folders[k]);
        struct safetensors *st = st_open(path, &err);
        float *m = st ? st_load_f32(st, mean, 1, dims, &n, &err) : NULL;
        for (size_t i = 0; m && !k && i < n; i++)
            max = fmax(max, fabs((double)m[i]));
        free(m);
        w[k] = st ? st_load_f32(st, layer, 4, dims, &n, &err) : NULL;
        st_close(st);
        if (!w[k]) {
            printf("%s\n", err.text);
            exit(1);
        }
    }
    for (size_t i = 0; i < n; i++)
        *far = fmax(*far, fabs((double)w[0][i] - (double)w[1][i]));
    free(w[0]);
    free(w[1]);
    return max;
}

static void check_running_norm(const struct head *h, const char *data)
{
    struct train_config c;
    struct error err = {0};
    double far;
    int rc;

    if (train_config_parse(&c, config, "config", &err))
        exit(1);
    rc = resume_run("start", data, h, 0, &c, &err) ||
         resume_run("moving", data, h, 2, &c, &err);
    c.running_norm = 1;
    rc = rc || resume_run("still", data, h, 2, &c, &err);
    if (rc)
        printf("%s\n", err.text);
    expect("runs with either norm end well", rc, 0, 0);
    expect("running means move",
           largest_mean("moving", "start", &far) > 1e-3, 1, 0);
    expect("with running_norm they stay",
           largest_mean("still", "start", &far), 0, 0);
    expect("and the weights learn", far > 1e-5, 1, 0);
    train_config_release(&c);
}

/* ---- the guard ---------------------------------------------------------- */

static int poison_pass(struct task *t, double *parts, uint64_t step,
                       size_t micro, struct error *err)
{
    (void)micro, (void)err;
    parts[0] = 1;
    t->ps.g[0] = 1;
    if (step >= 2)
        param_g(&t->ps, 1)[3] = NAN;
    return 0;
}

static void resume_nothing(struct task *t)
{
    (void)t;
}

static void check_guard(const char *data)
{
    static const struct task_type type = {
        .margin = 1.5, .release = resume_nothing, .pass = poison_pass
    };
    struct train_config c;
    struct task task = {.type = &type, .config = &c};
    struct group group = {0, 1};
    char path[200];
    struct loop loop = {.config = &c, .task = &task, .group = &group,
                        .folder = path, .warn = on_warn};
    struct error err = {0};
    size_t dim[1] = {8};
    int rc;

    snprintf(path, sizeof path, "%s/guard", folder);
    if (train_config_parse(&c, config, "config", &err))
        exit(1);
    c.steps = 100;
    params_init(&task.ps);
    params_add(&task.ps, "first", 1, dim, PARAM_ZERO, 1);
    params_add(&task.ps, "second", 1, dim, PARAM_ZERO, 1);
    if (params_allocate(&task.ps, &err) ||
        params_allocate_gradients(&task.ps, &err))
        exit(1);
    warnings = 0;
    loop.reader = data_open(&data, 1, 1.5, &err);
    rc = loop_run(&loop, &err);
    printf("%s\n%s\n", warned, err.text);
    expect("repeated NaN ends the run", rc, -1, 0);
    expect("the tensor is named", strstr(warned, "second") != NULL, 1, 0);
    expect("steps skipped", warnings, LOOP_MAX_BAD, 0);
    expect("nothing reached the weights", isfinite(param_w(&task.ps, 1)[3]),
           1, 0);
    data_close(loop.reader);
    params_release(&task.ps);
    train_config_release(&c);
}

/* ---- the motion loss's gradient ----------------------------------------- */

static double resume_evaluate(float *dout, const float *out,
                              const struct data_frame *f, struct square q,
                              struct motion_loss *l, bool square, float huber)
{
    struct motion_weights w = {
        .term = {100, 10, 5, 10, 1, 1, 1, 1, 1, 1, l->partner ? 0.5f : 0},
        .square_landmarks = square, .huber = huber};
    double parts[TERM_COUNT] = {0};
    struct motion_state s;
    float ignore[MOTION_OUT] = {0};

    return motion_loss(dout ? dout : ignore, parts, &s, out, f, q, &w, 1, l);
}

static void check_gradient(const char *what, const struct head *h,
                           const char *data, bool square, float huber,
                           bool paired)
{
    struct error err = {0};
    struct data_reader *in = data_open(&data, 1, 1.5, &err);
    struct data_person p;
    struct identity id = {0};
    struct motion_loss l;
    struct motion_error partner;
    struct random r;
    float out[MOTION_OUT], dout[MOTION_OUT] = {0}, c[MOTION_OUT];
    double worst = 0, e = 1e-3;

    if (!in || data_next(in, &p, &err) ||
        head_fold(&id, h, p.shape, h->nshape, &err) ||
        motion_loss_init(&l, h, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    l.id = &id;
    random_init(&r, 1, "gradient");
    for (int i = 0; i < MOTION_OUT; i++)
        out[i] = (float)(0.3 * random_normal(&r));
    out[0] += 1;
    out[4] -= 1;
    out[MOTION_TRANS + 2] = 6.5f;
    if (paired) {
        motion_error(&partner, out, &p.frame[0], p.frame[0].crop, &l);
        l.partner = &partner;
    }
    resume_evaluate(dout, out, &p.frame[1], p.frame[1].crop, &l, square,
                    huber);
    for (int i = 0; i < MOTION_OUT; i += i < 16 ? 1 : 7) {
        double f[2];
        for (int k = 0; k < 2; k++) {
            memcpy(c, out, sizeof c);
            c[i] += (float)(k ? e : -e);
            f[k] = resume_evaluate(NULL, c, &p.frame[1], p.frame[1].crop, &l,
                                   square, huber);
        }
        worst = fmax(worst, fabs((f[1] - f[0]) / (2 * e) - dout[i]) /
                                (fabs(dout[i]) + 0.3));
    }
    /* |x| is not smooth: some of 360 coordinates cross zero in a step. */
    expect(what, worst, 0, 0.02);
    motion_loss_release(&l);
    identity_release(&id);
    data_person_release(&p);
    data_close(in);
}

int main(void)
{
    struct head h;
    char data[200], cmd[100];

    if (!mkdtemp(folder))
        return 1;
    snprintf(data, sizeof data, "%s/people.spid", folder);
    toy_head(&h, 8);
    toy_stream(data, &h, 5, 4, 96);
    check_gradient("motion loss gradient", &h, data, false, 0, false);
    check_gradient("squared landmarks", &h, data, true, 0, false);
    check_gradient("of a pair", &h, data, false, 0, true);
    check_gradient("Huber's", &h, data, false, 1, true);
    check_gradient("Huber's, all but squares", &h, data, false, 100, true);
    check_running_norm(&h, data);
    check_guard(data);
    check_resume(&h, data);
    head_release(&h);
    snprintf(cmd, sizeof cmd, "rm -rf %s", folder);
    return system(cmd) || check_status();
}
