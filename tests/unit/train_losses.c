/* Every picture loss against central differences, and Adam against its
 * formulas in double. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/data/data.h"
#include "lib/lab/train/adam.h"
#include "lib/lab/train/losses.h"
#include "tests/check.h"

enum { H = 21, W = 26, NV = 3 * H * W };

static double losses_evaluate(int which, float *db, const float *b,
                              const float *a)
{
    static const struct box box = {3, 2, 22, 19}, odd = {0, 0, 1, 5};
    float *tmp = malloc(loss_pyramid_scratch(H, W) * sizeof *tmp);
    double loss = 0;

    switch (which) {
    case 0: loss = loss_l1(db, b, a, H, W, NULL, 2); break;
    case 1: loss = loss_l1(db, b, a, H, W, &box, 2); break;
    case 2: loss = loss_l2(db, b, a, NV, 3); break;
    case 3: loss = loss_pyramid(db, b, a, H, W, NULL, 2, tmp); break;
    case 4: loss = loss_pyramid(db, b, a, H, W, &box, 2, tmp); break;
    case 5: loss = loss_pyramid(db, b, a, H, W, &odd, 2, tmp); break;
    }
    free(tmp);
    return loss;
}

/* Along random directions: the gradient's inner product with each. */
static void check_loss(int which, const char *name)
{
    float *a = malloc(4 * NV * sizeof *a), *b = a + NV, *g = b + NV;
    float *c = g + NV;
    struct random r;
    double worst = 0;

    random_init(&r, 3, name);
    for (int i = 0; i < NV; i++) {
        a[i] = (float)random_uniform(&r);
        b[i] = (float)random_uniform(&r);
    }
    memset(g, 0, NV * sizeof *g);
    losses_evaluate(which, g, b, a);
    for (int k = 0; k < 8; k++) {
        double want = 0, f[2], e = 3e-5;
        float dir[NV];
        for (int i = 0; i < NV; i++) {
            dir[i] = (float)random_normal(&r);
            want += (double)dir[i] * g[i];
        }
        for (int s = 0; s < 2; s++) {
            for (int i = 0; i < NV; i++)
                c[i] = b[i] + (float)(s ? e : -e) * dir[i];
            f[s] = losses_evaluate(which, NULL, c, a);
        }
        worst = fmax(worst, fabs((f[1] - f[0]) / (2 * e) - want) /
                                (fabs(want) + 0.1));
    }
    /* A few |x| cross zero within the step, and sums are of floats. */
    expect(name, worst, 0, 0.03);
    free(a);
}

static void check_adam(void)
{
    struct params ps;
    struct adam a;
    size_t dim[1] = {5};
    double w[5], m[5] = {0}, v[5] = {0}, worst = 0, norm;

    params_init(&ps);
    params_add(&ps, "a", 1, dim, PARAM_ZERO, 1);
    params_add(&ps, "b.running_mean", 1, dim, PARAM_ZERO, 1);
    ps.tensor[1].frozen = true;
    if (params_allocate(&ps, NULL) || params_allocate_gradients(&ps, NULL))
        exit(1);
    for (int i = 0; i < 5; i++) {
        w[i] = param_w(&ps, 0)[i] = (float)(i + 1);
        param_w(&ps, 1)[i] = 7;
    }
    if (adam_init(&a, &ps, 1, 0.5f, NULL))
        exit(1);
    for (int t = 1; t <= 20; t++) {
        for (int i = 0; i < 5; i++) {
            param_g(&ps, 0)[i] = (float)(w[i] * 2 + t % 3);
            param_g(&ps, 1)[i] = 99;
        }
        norm = adam_norm(&ps);
        for (int i = 0; i < 5; i++) {
            double g = param_g(&ps, 0)[i] / fmax(1, norm);
            m[i] = 0.9 * m[i] + 0.1 * g;
            v[i] = 0.999 * v[i] + 0.001 * g * g;
            w[i] -= 0.01 * (m[i] / (1 - pow(0.9, t))) /
                    (sqrt(v[i] / (1 - pow(0.999, t))) + 1e-8);
        }
        adam_update(&a, &ps, 0.01, norm);
        for (int i = 0; i < 5; i++)
            worst = fmax(worst, fabs(w[i] - param_w(&ps, 0)[i]));
    }
    expect("Adam against double, 20 steps", worst, 0, 2e-5);
    expect("a frozen tensor does not move", param_w(&ps, 1)[2], 7, 0);
    param_g(&ps, 0)[3] = NAN;
    expect("first bad tensor", (double)adam_first_bad(&ps), 0, 0);
    adam_release(&a);
    params_release(&ps);
}

/* A picture of 200 pixels drawn with 100: positions halve. */
static void check_mouth(void)
{
    struct data_frame f = {.size = 200, .crop.size = 100};

    for (int j = 60; j <= 67; j++) {
        f.lmk[j][0] = (float)(70 + 4 * (j - 60));
        f.lmk[j][1] = 120;
    }
    f.lmk[66][0] = f.lmk[62][0];
    f.lmk[62][1] = 119;
    f.lmk[66][1] = 121;
    struct box shut = data_mouth(&f, 100);
    expect("lips 2 % of the crop apart are shut",
           (double)(shut.x1 + shut.y1), 0, 0);
    f.lmk[62][1] = 110;
    f.lmk[66][1] = 130;
    struct box open = data_mouth(&f, 100);
    expect("open mouth, left", (double)open.x0, 35, 0);
    expect("open mouth, top", (double)open.y0, 55, 0);
    expect("open mouth, right", (double)open.x1, 49, 0);
    expect("open mouth, bottom", (double)open.y1, 65, 0);
}

int main(void)
{
    check_mouth();
    check_loss(0, "l1, whole picture");
    check_loss(1, "l1, box");
    check_loss(2, "l2");
    check_loss(3, "pyramid, whole picture");
    check_loss(4, "pyramid, box");
    check_loss(5, "pyramid, one pixel wide");
    check_adam();
    return check_status();
}
