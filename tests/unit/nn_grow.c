/* A motion encoder grown from a narrower one says what that one says, and the
 * new channels learn: their columns have a gradient.  A wider file, another
 * kernel and an absent tensor are refused by name. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/safetensors.h"
#include "lib/base/random.h"
#include "lib/net/motion_encoder.h"
#include "tests/check.h"

#define NARROW "mobilenetv3_small_100"
#define WIDE "mobilenetv3_small_150"
#define PIXELS (MOTION_ENCODER_SIZE * MOTION_ENCODER_SIZE * 3)

static struct error err;
static void grow_must(int rc)
{
    if (rc) {
        printf("%s\n", err.text);
        exit(1);
    }
}

static void grow_declare(struct motion_encoder *net, struct params *ps,
                         const char *variant, const char *prefix)
{
    params_init(ps);
    grow_must(motion_encoder_init(net, ps, prefix, variant, &err));
    grow_must(params_allocate(ps, &err));
    grow_must(params_allocate_gradients(ps, &err));
    params_randomise(ps, 3);
}

/* Running means and biases that are not the start's zeros. */
static void grow_live(struct params *ps)
{
    struct random r;

    random_init(&r, 8, "grow");
    for (size_t i = 0; i < ps->count; i++)
        if (ps->tensor[i].ndim == 1)
            for (size_t k = 0; k < ps->tensor[i].count; k++)
                param_w(ps, i)[k] += (float)random_range(&r, 0, 0.2);
}

static void grow_look(float out[MOTION_OUT], struct motion_encoder *net,
                      const float *rgb, enum nn_mode mode)
{
    grow_must(motion_encoder_plan(net, 1, (struct nn_options){mode, NN_F32},
                                  &err));
    motion_encoder_forward(out, rgb, net);
}

/* Whether some new column of an old row has a gradient. */
static bool columns_learn(const struct params *ps, const char *name,
                          size_t rows, size_t cols)
{
    size_t i = params_find(ps, name), all = ps->tensor[i].dim[1];
    const float *g = param_g(ps, i);

    for (size_t r = 0; r < rows; r++)
        for (size_t c = cols; c < all; c++)
            if (g[r * all + c] != 0)
                return true;
    return false;
}

static void grow_refused(const char *path, const char *variant,
                         const char *prefix, const char *from, const char *why)
{
    struct motion_encoder net;
    struct params ps;
    struct safetensors *st = st_open(path, &err);
    struct error said = {0};

    if (!st)
        grow_must(-1);
    grow_declare(&net, &ps, variant, prefix);
    check_that(why, params_grow_from(&ps, st, prefix, from, &said) != 0);
    check_that("file and tensor are named",
               strstr(said.text, path) && strstr(said.text, from));
    printf("%s: %s\n", why, said.text);
    st_close(st);
    motion_encoder_release(&net);
    params_release(&ps);
}

int main(void)
{
    static float rgb[PIXELS];
    char path[] = "/tmp/spid-grow-XXXXXX";
    float a[MOTION_OUT], b[MOTION_OUT], ones[MOTION_OUT];
    struct motion_encoder narrow, wide;
    struct params nps, wps;
    struct safetensors *st;
    struct random r;
    double worst = 0, max = 0;
    int fd = mkstemp(path);

    random_init(&r, 9, "grow picture");
    for (size_t i = 0; i < PIXELS; i++)
        rgb[i] = (float)random_uniform(&r);
    grow_declare(&narrow, &nps, NARROW, "motion.");
    grow_live(&nps);
    grow_must(params_save(&nps, path, ST_F32, NULL, &err));
    st = st_open(path, &err);
    if (!st)
        grow_must(-1);
    grow_declare(&wide, &wps, WIDE, "m.");
    grow_must(params_grow_from(&wps, st, "m.", "motion.", &err));
    st_close(st);
    grow_look(a, &narrow, rgb, NN_INFER);
    grow_look(b, &wide, rgb, NN_INFER);
    for (int k = 0; k < MOTION_OUT; k++) {
        worst = fmax(worst, fabs((double)a[k] - (double)b[k]));
        max = fmax(max, fabs((double)a[k]));
        ones[k] = 1;
    }
    printf("wide and narrow differ by %.1e of %.1e\n", worst, max);
    check_that("the same function", max > 0 && worst < 1e-5 * max);

    grow_look(b, &wide, rgb, NN_FROZEN);
    motion_encoder_backward(NULL, ones, &wide);
    check_that("heads learn", columns_learn(&wps, "m.exp.weight", 100, 576));
    check_that("inner layers learn",
               columns_learn(&wps, "m.encoder.blocks.4.1.conv_pwl.weight", 96,
                             576));
    grow_must(params_save(&wps, path, ST_F32, NULL, &err));
    grow_refused(path, NARROW, "motion.", "m.", "a wider file is refused");
    grow_must(params_save(&nps, path, ST_F32, NULL, &err));
    grow_refused(path, "tf_mobilenetv3_small_minimal_100", "motion.", "motion.",
                 "another kernel is refused");
    grow_refused(path, WIDE, "motion.", "other.",
                 "an absent tensor is refused");
    close(fd);
    unlink(path);
    motion_encoder_release(&narrow);
    motion_encoder_release(&wide);
    params_release(&nps);
    params_release(&wps);
    return check_status();
}
