/* SqueezeNet 1.0: the features and the gradient for the picture against plain
 * loops in double with random weights, the gradient by central differences;
 * and, where the weights are ($SPID_ASSETS/perceptual, or beside the project
 * in ../shared/assets), against features computed in double elsewhere.  Sums
 * in float: 2e-5 of a layer's largest value; the gradient along a
 * direction: 1e-6 of its length. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/safetensors.h"
#include "lib/lab/eval/squeezenet.h"
#include "tests/check.h"
#include "tests/unit/noise.h"

#define SIDE 33

/* A map in double, (h,w,C). */
struct map {
    size_t h, w, C;
    double *v;
};

static struct map map_of(size_t h, size_t w, size_t C)
{
    struct map m = { h, w, C, calloc(h * w * C, sizeof(double)) };

    if (!m.v)
        exit(1);
    return m;
}

/* relu(conv) with `half` pixels of zeros around, into channels [at, ...) of
 * out. */
static void plain_conv(struct map *out, size_t at, const struct map *in,
                       const struct conv *c, size_t half)
{
    const float *w = param_w(c->ps, c->weight), *b = param_w(c->ps, c->bias);

    for (size_t i = 0; i < out->h * out->w * c->out; i++) {
        size_t o = i % c->out, x = i / c->out % out->w, y = i / c->out /
                                                            out->w;
        double sum = (double)b[o];

        for (size_t k = 0; k < c->kernel * c->kernel; k++) {
            size_t yy = y * c->stride + k / c->kernel;
            size_t xx = x * c->stride + k % c->kernel;

            if (yy < half || yy >= in->h + half || xx < half ||
                xx >= in->w + half)
                continue;
            const double *p = in->v + ((yy - half) * in->w + xx - half) *
                                          in->C;
            for (size_t j = 0; j < c->in; j++)
                sum += p[j] * (double)w[(o * c->in + j) * c->kernel *
                                            c->kernel + k];
        }
        out->v[(y * out->w + x) * out->C + at + o] = sum > 0 ? sum : 0;
    }
}

static struct map plain_pool(const struct map *in)
{
    struct map out = map_of(max_pool_size(in->h, true), max_pool_size(in->w, true),
                            in->C);

    for (size_t i = 0; i < out.h * out.w * out.C; i++) {
        size_t c = i % out.C, x = i / out.C % out.w, y = i / out.C / out.w;
        double max = -INFINITY;

        for (size_t yy = 2 * y; yy < 2 * y + 3 && yy < in->h; yy++)
            for (size_t xx = 2 * x; xx < 2 * x + 3 && xx < in->w; xx++)
                max = fmax(max, in->v[(yy * in->w + xx) * in->C + c]);
        out.v[i] = max;
    }
    return out;
}

/* All layers; the caller frees them. */
static void plain_net(struct map layer[SQUEEZENET_LAYERS],
                      const struct map *rgb, const struct squeezenet *s)
{
    layer[0] = map_of((rgb->h - 7) / 2 + 1, (rgb->w - 7) / 2 + 1, 96);
    plain_conv(&layer[0], 0, rgb, &s->tape.map[s->layer[0]]->conv, 0);
    for (size_t i = 0; i < SQUEEZENET_FIRES; i++) {
        struct tape_step *const *both = s->tape.map[s->layer[i + 1]]->of;
        const struct conv *squeeze = &both[0]->of[0]->conv;
        const bool pooled = i == 0 || i == 3 || i == 7;
        struct map x = layer[i];

        if (pooled)
            x = plain_pool(&layer[i]);
        struct map few = map_of(x.h, x.w, squeeze->out);
        layer[i + 1] = map_of(x.h, x.w, 2 * both[0]->conv.out);
        plain_conv(&few, 0, &x, squeeze, 0);
        plain_conv(&layer[i + 1], 0, &few, &both[0]->conv, 0);
        plain_conv(&layer[i + 1], both[0]->conv.out, &few, &both[1]->conv, 1);
        free(few.v);
        if (pooled)
            free(x.v);
    }
}

/* sum over layers of layer . probe */
static double plain_loss(const struct map *rgb, float *const *probe,
                         const struct squeezenet *s)
{
    struct map layer[SQUEEZENET_LAYERS];
    double sum = 0;

    plain_net(layer, rgb, s);
    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++) {
        size_t n = layer[k].h * layer[k].w * layer[k].C;

        for (size_t i = 0; i < n && probe[k]; i++)
            sum += layer[k].v[i] * (double)probe[k][i];
        free(layer[k].v);
    }
    return sum;
}

/* Greatest difference over the greatest value. */
static double squeezenet_relative(const float *x, const double *truth, size_t n)
{
    double max = 0, size = 1e-30;

    for (size_t i = 0; i < n; i++) {
        max = fmax(max, fabs((double)x[i] - truth[i]));
        size = fmax(size, fabs(truth[i]));
        if (isnan(x[i]))
            return INFINITY;
    }
    return max / size;
}

static void check_layers(struct squeezenet *s, const struct map *rgb)
{
    struct map layer[SQUEEZENET_LAYERS];
    char what[32];
    size_t shape[4];

    plain_net(layer, rgb, s);
    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++) {
        const float *x = squeezenet_layer(shape, s,
                                          (enum squeezenet_layer)k);
        size_t n = layer[k].h * layer[k].w * layer[k].C;

        snprintf(what, sizeof what, "layer %zu", k);
        check_that("sizes", shape[1] == layer[k].h && shape[2] == layer[k].w &&
                                shape[3] == layer[k].C);
        check(what, squeezenet_relative(x, layer[k].v, n), 2e-5);
        free(layer[k].v);
    }
}

static void check_gradient(struct squeezenet *s, struct map *rgb)
{
    float *probe[SQUEEZENET_LAYERS], *drgb = malloc(SIDE * SIDE * 3 *
                                                    sizeof *drgb);
    size_t shape[4], n = SIDE * SIDE * 3;

    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++) {
        squeezenet_layer(shape, s, (enum squeezenet_layer)k);
        /* some layers have no part in a loss */
        probe[k] = k % 3 == 1 ? NULL
            : noise_make("squeezenet", shape[1] * shape[2] * shape[3],
                         10 + k, -1, 1);
    }
    squeezenet_backward(drgb, (const float *const *)probe, s);
    for (uint64_t d = 0; d < 3; d++) {
        float *way = noise_make("squeezenet", n, 30 + d, -1, 1);
        double eps = 1e-7, ours = 0, along, length = 0, size = 0;

        for (size_t i = 0; i < n; i++) {
            ours += (double)drgb[i] * (double)way[i];
            length += (double)way[i] * (double)way[i];
            size += (double)drgb[i] * (double)drgb[i];
            rgb->v[i] += eps * (double)way[i];
        }
        along = plain_loss(rgb, probe, s);
        for (size_t i = 0; i < n; i++)
            rgb->v[i] -= 2 * eps * (double)way[i];
        along = (along - plain_loss(rgb, probe, s)) / (2 * eps);
        for (size_t i = 0; i < n; i++)
            rgb->v[i] += eps * (double)way[i];
        check("gradient along a direction",
              fabs(along - ours) / sqrt(length * size), 1e-6);
        free(way);
    }
    for (size_t k = 0; k < SQUEEZENET_LAYERS; k++)
        free(probe[k]);
    free(drgb);
}

static void check_random(void)
{
    const struct nn_options opt = { NN_FROZEN, NN_F32 };
    struct squeezenet s;
    struct params ps;
    struct error err = { 0 };

    params_init(&ps);
    squeezenet_init(&s, &ps);
    if (params_allocate(&ps, &err))
        exit(1);
    params_randomise(&ps, 6);   /* no unit within rounding of its kink */
    for (size_t t = 0; t < ps.count; t++)
        for (size_t i = 0; i < ps.tensor[t].count; i++)
            param_w(&ps, t)[i] *= 1.5f;
    check_error("plan", !squeezenet_plan(&s, SIDE, SIDE, opt, &err), &err);
    float *x = noise_make("squeezenet", SIDE * SIDE * 3, 4, 0, 1);
    struct map rgb = map_of(SIDE, SIDE, 3);
    for (size_t i = 0; i < SIDE * SIDE * 3; i++)
        rgb.v[i] = (double)x[i];
    squeezenet_forward(x, &s);
    check_layers(&s, &rgb);
    check_gradient(&s, &rgb);
    check_that("a picture too small is refused",
               squeezenet_plan(&s, 9, 30, opt, &err) != 0);
    free(x);
    free(rgb.v);
    squeezenet_release(&s);
    params_release(&ps);
}

/* One layer of the file, (1,C,h,w), against ours. */
static void check_stored(const struct safetensors *st, const char *name,
                         const float *x, const size_t s[4])
{
    struct error err = { 0 };
    size_t dim[4] = { 1, s[3], s[1], s[2] }, n = s[1] * s[2] * s[3];
    float *planes = st_load_f32(st, name, 4, dim, NULL, &err);
    double *truth = malloc(n * sizeof *truth);

    check_error(name, planes != NULL, &err);
    for (size_t i = 0; planes && i < n; i++)
        truth[i] = (double)planes[i % s[3] * s[1] * s[2] + i / s[3]];
    if (planes)
        check(name, squeezenet_relative(x, truth, n), 2e-5);
    free(truth);
    free(planes);
}

/* The pictures and the features stored beside the weights. */
static void check_file(const char *folder)
{
    const struct nn_options opt = { NN_FROZEN, NN_F32 };
    char path[1000], name[16];
    struct squeezenet s;
    struct params ps;
    struct error err = { 0 };
    size_t dim[4] = { 1, 3, 64, 64 }, shape[4];

    params_init(&ps);
    snprintf(path, sizeof path, "%s/squeezenet10.safetensors", folder);
    struct safetensors *st = st_open(path, &err);
    squeezenet_init(&s, &ps);
    bool ok = st &&
              !params_allocate(&ps, &err) && !params_load(&ps, st, "", &err) &&
              !squeezenet_plan(&s, 64, 64, opt, &err);
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
        squeezenet_forward(x, &s);
        for (int k = 0; k < SQUEEZENET_LAYERS; k++) {
            const float *y = squeezenet_layer(shape, &s,
                                              (enum squeezenet_layer)k);

            snprintf(name, sizeof name, k ? "fire%d" : "relu%d", k + 1);
            check_stored(st, name, y, shape);
        }
        const float *pool = tape_map(shape, &s.tape, s.layer[0] + 1);
        check_stored(st, "pool1", pool, shape);
        free(x);
    }
    free(in);
    st_close(st);
    squeezenet_release(&s);
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
