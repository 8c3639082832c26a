/* SqueezeNet 1.0: the features and the gradient for the picture against plain
 * loops in double with random weights, the gradient by central differences;
 * and, where the weights are ($SPID_ASSETS/perceptual, or beside the project
 * in ../shared/assets), against features computed in double elsewhere.  Sums
 * in float: 2e-5 of a layer's largest value; the gradient along a
 * direction: 1e-6 of its length. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/safetensors.h"
#include "lib/lab/eval/squeezenet.h"
#include "tests/check.h"
#include "tests/reference/map.h"
#include "tests/unit/noise.h"

#define SIDE 33

struct net {
    struct tape tape;
    int layer[SQUEEZENET_LAYERS];
};

/* relu(conv) with `pad` pixels of zeros around. */
static struct map plain_conv(const struct map *in, const struct conv *c,
                             size_t pad)
{
    struct map y = map_conv(in, param_w(c->ps, c->weight),
                            param_w(c->ps, c->bias), c->out, c->kernel,
                            c->stride, pad);

    map_relu(&y);
    return y;
}

/* All layers; the caller frees them. */
static void plain_net(struct map layer[SQUEEZENET_LAYERS],
                      const struct map *rgb, const struct net *s)
{
    layer[0] = plain_conv(rgb, s->tape.map[s->layer[0]]->layer, 0);
    for (size_t i = 0; i < SQUEEZENET_FIRES; i++) {
        struct tape_step *const *both = s->tape.map[s->layer[i + 1]]->of;
        const struct conv *squeeze = both[0]->of[0]->layer;
        const bool pooled = i == 0 || i == 3 || i == 7;
        struct map x = pooled ? map_max_pool(&layer[i], true) : layer[i];
        struct map few = plain_conv(&x, squeeze, 0);

        layer[i + 1] = map_make(x.h, x.w, 2 * both[0]->channels);
        for (size_t k = 0; k < 2; k++) {
            struct map half = plain_conv(&few, both[k]->layer, k);

            map_put(&layer[i + 1], k * half.C, &half);
            free(half.v);
        }
        free(few.v);
        if (pooled)
            free(x.v);
    }
}

struct probed {
    const struct net *net;
    float *probe[SQUEEZENET_LAYERS];    /* NULL: none of this layer */
};

/* For map_gradient_error: sum over layers of layer . probe */
static double plain_loss(const struct map *rgb, void *probed)
{
    const struct probed *p = probed;
    struct map layer[SQUEEZENET_LAYERS];
    double sum = 0;

    plain_net(layer, rgb, p->net);
    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++) {
        sum += p->probe[k] ? map_dot(&layer[k], p->probe[k]) : 0;
        free(layer[k].v);
    }
    return sum;
}

static void check_layers(struct net *s, const struct map *rgb)
{
    struct map layer[SQUEEZENET_LAYERS];
    char what[32];
    size_t shape[4];

    plain_net(layer, rgb, s);
    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++) {
        const float *x = tape_map(shape, &s->tape, s->layer[k]);

        snprintf(what, sizeof what, "layer %zu", k);
        check_that("sizes", shape[1] == layer[k].h && shape[2] == layer[k].w &&
                                shape[3] == layer[k].C);
        check(what, map_error(x, &layer[k]), 2e-5);
        free(layer[k].v);
    }
}

static void check_gradient(struct net *s, struct map *rgb)
{
    size_t shape[4], n = SIDE * SIDE * 3;
    float *drgb = malloc(n * sizeof *drgb);
    struct probed p = {.net = s};
    struct tape_seed seed[SQUEEZENET_LAYERS];

    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++) {
        tape_map(shape, &s->tape, s->layer[k]);
        /* some layers have no part in a loss */
        p.probe[k] = k % 3 == 1 ? NULL
            : noise_make("squeezenet", shape[1] * shape[2] * shape[3],
                         10 + k, -1, 1);
        seed[k] = (struct tape_seed){s->layer[k], p.probe[k]};
    }
    tape_backward(drgb, seed, SQUEEZENET_LAYERS, &s->tape);
    for (uint64_t d = 0; d < 3; d++) {
        float *way = noise_make("squeezenet", n, 30 + d, -1, 1);

        check("gradient along a direction",
              map_gradient_error(drgb, rgb, way, plain_loss, &p), 1e-6);
        free(way);
    }
    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++)
        free(p.probe[k]);
    free(drgb);
}

static void check_random(void)
{
    const struct nn_options opt = { NN_FROZEN, NN_F32 };
    struct net s;
    struct params ps;
    struct error err = { 0 };

    params_init(&ps);
    tape_init(&s.tape, &ps, 3, true);
    squeezenet_declare(s.layer, &s.tape);
    if (params_allocate(&ps, &err))
        exit(1);
    params_randomise(&ps, 6);   /* no unit within rounding of its kink */
    for (size_t t = 0; t < ps.count; t++)
        for (size_t i = 0; i < ps.tensor[t].count; i++)
            param_w(&ps, t)[i] *= 1.5f;
    check_error("plan", !tape_plan(&s.tape, 1, SIDE, SIDE, opt, &err), &err);
    float *x = noise_make("squeezenet", SIDE * SIDE * 3, 4, 0, 1);
    struct map rgb = map_of(x, SIDE, SIDE, 3);
    tape_forward(NULL, x, &s.tape);
    check_layers(&s, &rgb);
    check_gradient(&s, &rgb);
    free(x);
    free(rgb.v);
    tape_release(&s.tape);
    params_release(&ps);
}

/* One layer of the file, (1,C,h,w), against ours. */
static void check_stored(const struct safetensors *st, const char *name,
                         const float *x, const size_t s[4])
{
    struct error err = { 0 };
    size_t dim[4] = { 1, s[3], s[1], s[2] }, n = s[1] * s[2] * s[3];
    float *planes = st_load_f32(st, name, 4, dim, NULL, &err);
    struct map truth = map_make(s[1], s[2], s[3]);

    check_error(name, planes != NULL, &err);
    for (size_t i = 0; planes && i < n; i++)
        truth.v[i] = (double)planes[i % s[3] * s[1] * s[2] + i / s[3]];
    if (planes)
        check(name, map_error(x, &truth), 2e-5);
    free(truth.v);
    free(planes);
}

/* The pictures and the features stored beside the weights. */
static void check_file(const char *folder)
{
    const struct nn_options opt = { NN_FROZEN, NN_F32 };
    char path[1000], name[16];
    struct net s;
    struct params ps;
    struct error err = { 0 };
    size_t dim[4] = { 1, 3, 64, 64 }, shape[4];

    params_init(&ps);
    snprintf(path, sizeof path, "%s/squeezenet10.safetensors", folder);
    struct safetensors *st = st_open(path, &err);
    tape_init(&s.tape, &ps, 3, true);
    squeezenet_declare(s.layer, &s.tape);
    bool ok = st &&
              !params_allocate(&ps, &err) && !params_load(&ps, st, "", &err) &&
              !tape_plan(&s.tape, 1, 64, 64, opt, &err);
    check_error("weights", ok, &err);
    st_close(st);
    snprintf(path, sizeof path, "%s/golden.safetensors", folder);
    st = st_open(path, &err);
    float *in = st ? st_load_f32(st, "input", 4, dim, NULL, &err) : NULL;
    check_error("stored picture", in != NULL, &err);
    if (ok && in) {
        float *x = malloc(64 * 64 * 3 * sizeof *x);

        for (size_t i = 0; i < 64 * 64 * 3; i++)
            x[i] = in[i % 3 * 64 * 64 + i / 3];
        tape_forward(NULL, x, &s.tape);
        for (int k = 0; k < SQUEEZENET_LAYERS; k++) {
            const float *y = tape_map(shape, &s.tape, s.layer[k]);

            snprintf(name, sizeof name, k ? "fire%d" : "relu%d", k + 1);
            check_stored(st, name, y, shape);
        }
        const float *pool = tape_map(shape, &s.tape, s.layer[0] + 1);
        check_stored(st, "pool1", pool, shape);
        free(x);
    }
    free(in);
    st_close(st);
    tape_release(&s.tape);
    params_release(&ps);
}

int main(void)
{
    const char *assets = getenv("SPID_ASSETS");
    char folder[900], path[1000];

    check_random();
    snprintf(folder, sizeof folder, "%s/perceptual",
             assets ? assets : "../shared/assets");
    snprintf(path, sizeof path, "%s/golden.safetensors", folder);
    FILE *f = fopen(path, "rb");
    if (f) {
        fclose(f);
        check_file(folder);
    } else {
        printf("no stored features at %s: not compared with them (set "
               "SPID_ASSETS)\n", folder);
    }
    return check_status();
}
