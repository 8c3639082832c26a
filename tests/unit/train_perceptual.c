/* The perceptual loss of both networks with random weights: nothing for the
 * picture itself, the gradient by central differences along its own signs
 * (0.5 % of its length: features are floats, and units have kinks), nothing
 * outside the box, and a file that is not there refused by name. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "lib/base/random.h"
#include "lib/lab/train/perceptual.h"
#include "tests/check.h"
#include "tests/unit/noise.h"

#define H 70
#define W 90
#define N (3 * H * W)

static float a[N], b[N], db[N], way[N], moved[N];

/* Weights for a network, random, at path. */
static void write_weights(const char *path)
{
    struct lpips s;
    struct error err = { 0 };

    lpips_declare(&s, LPIPS_SQUEEZENET);
    if (params_allocate(&s.ps, &err))
        exit(1);
    params_randomise(&s.ps, 6);
    if (params_save(&s.ps, path, NULL, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    lpips_release(&s);
}

/* LPIPS's, with weights of channels above 0 as the learned ones are. */
static void write_lpips(const char *path)
{
    static const struct {
        const char *name;
        size_t dim[4];
    } conv[5] = {{"0", {64, 3, 11, 11}}, {"3", {192, 64, 5, 5}},
                 {"6", {384, 192, 3, 3}}, {"8", {256, 384, 3, 3}},
                 {"10", {256, 256, 3, 3}}};
    struct params ps;
    struct error err = { 0 };
    char name[40];

    params_init(&ps);
    for (size_t i = 0; i < 5; i++) {
        const size_t lin[4] = { 1, conv[i].dim[0], 1, 1 };

        snprintf(name, sizeof name, "features.%s.weight", conv[i].name);
        params_add(&ps, name, 4, conv[i].dim, PARAM_HE, 1.4f);
        snprintf(name, sizeof name, "features.%s.bias", conv[i].name);
        params_add(&ps, name, 1, conv[i].dim, PARAM_NORMAL, 0.1f);
        snprintf(name, sizeof name, "lin%zu.model.1.weight", i);
        params_add(&ps, name, 4, lin, PARAM_CONSTANT, 0.1f + 0.1f * (float)i);
    }
    if (params_allocate(&ps, &err))
        exit(1);
    params_randomise(&ps, 6);
    if (params_save(&ps, path, NULL, &err))
        exit(1);
    params_release(&ps);
}

/* Along a smooth direction, so that few units change sign. */
static void check_gradient(struct perceptual *p, const struct box *box,
                           const char *what)
{
    double eps = 3e-5, ours = 0, length = 0, size = 0, step[2];

    memset(db, 0, sizeof db);
    perceptual_target(p, a, H, W, box);
    double loss = perceptual_loss(db, b, H, W, box, 3, p);
    check_range(what, loss, 1e-4, 3 * 4);
    for (size_t i = 0; i < N; i++) {
        way[i] = db[i] > 0 ? 1 : db[i] < 0 ? -1 : 0;
        ours += (double)db[i] * (double)way[i];
        length += (double)way[i] * (double)way[i];
        size += (double)db[i] * (double)db[i];
    }
    for (int k = 0; k < 2; k++) {
        for (size_t i = 0; i < N; i++)
            moved[i] = b[i] + (k ? -1 : 1) * (float)eps * way[i];
        step[k] = perceptual_loss(NULL, moved, H, W, box, 3, p);
    }
    double along = (step[0] - step[1]) / (2 * eps);
    check("gradient against differences",
          fabs(along - ours) / sqrt(length * size), 5e-3);
}

/* All that is asked of either network's file, which is removed. */
static void check_network(const char *path)
{
    const struct box face = { 20, 10, 75, 62 }, none = { 5, 5, 5, 9 };
    struct perceptual p;
    struct error err = { 0 };

    check_error("open", !perceptual_open(&p, path, 64, &err), &err);
    noise_waves(a, "perceptual", N, 1, W, 0);
    noise_waves(b, "perceptual", N, 2, W, 0.7);
    perceptual_target(&p, a, H, W, NULL);
    check("the picture itself", perceptual_loss(NULL, a, H, W, NULL, 1, &p),
          1e-12);
    check_gradient(&p, NULL, "the whole picture");
    check_gradient(&p, &face, "a box");
    double outside = 0;
    for (size_t i = 0; i < N; i++) {
        size_t x = i / 3 % W, y = i / 3 / W;

        if (x < face.x0 || x >= face.x1 || y < face.y0 || y >= face.y1)
            outside += fabs((double)db[i]);
    }
    check("outside the box", outside, 0);
    check("an empty box", perceptual_loss(db, b, H, W, &none, 1, &p), 0);
    perceptual_release(&p);
    check_that("a picture too small is refused",
               perceptual_open(&p, path, 9, &err) != 0);
    remove(path);
    check_that("no file", perceptual_open(&p, path, 64, &err) != 0 &&
                              strstr(err.text, path) != NULL);
}

int main(void)
{
    char path[64];

    snprintf(path, sizeof path, "/tmp/%ld-perceptual-test.safetensors",
             (long)getpid());
    write_weights(path);
    check_network(path);
    write_lpips(path);
    check_network(path);
    return check_status();
}
