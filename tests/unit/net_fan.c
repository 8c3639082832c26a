/* The face alignment network, narrow and on small pictures: its heat maps and
 * the gradient for the picture against plain loops in double with random
 * weights, the gradient by central differences; and the loss made of it.  Sums
 * in float: 2e-5 of a map's largest value; the gradient along a direction:
 * 1e-6 of its length. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/train/alignment.h"
#include "tests/check.h"
#include "tests/folder.h"
#include "tests/reference/map.h"
#include "tests/unit/noise.h"

#define SIDE 64
#define STACKS 2
#define WIDTH 32

static const struct params *weights;

static const float *fan_tensor(const char *name, const char *part)
{
    char buf[120];
    size_t i = params_find(weights, nn_name(buf, "%s.%s", name, part));

    return i == (size_t)-1 ? NULL : param_w(weights, i);
}

/* In place; n pixels of C channels. */
static void plain_norm_relu(struct map *m, const char *name)
{
    const float *w = fan_tensor(name, "weight"), *b = fan_tensor(name, "bias");
    const float *mean = fan_tensor(name, "running_mean");
    const float *var = fan_tensor(name, "running_var");

    for (size_t i = 0; i < m->h * m->w * m->C; i++) {
        size_t c = i % m->C;
        double y = (m->v[i] - (double)mean[c]) * (double)w[c] /
                       sqrt((double)var[c] + 1e-5) + (double)b[c];

        m->v[i] = fmax(0, y);
    }
}

static struct map plain_conv(const struct map *x, const char *name, size_t out,
                             size_t kernel, size_t stride)
{
    return map_conv(x, fan_tensor(name, "weight"), fan_tensor(name, "bias"),
                    out, kernel, stride, kernel / 2);
}

static struct map plain_copy(const struct map *x)
{
    struct map y = map_make(x->h, x->w, x->C);

    map_put(&y, 0, x);
    return y;
}

static void plain_add(struct map *y, const struct map *x)
{
    for (size_t i = 0; i < y->h * y->w * y->C; i++)
        y->v[i] += x->v[i];
}

/* conv(relu(norm x)) */
static struct map plain_step(const struct map *x, const char *block,
                             const char *norm, const char *conv, size_t out,
                             size_t kernel)
{
    struct map a = plain_copy(x), y;
    char buf[120];

    plain_norm_relu(&a, nn_name(buf, "%s.%s", block, norm));
    y = plain_conv(&a, nn_name(buf, "%s.%s", block, conv), out, kernel, 1);
    free(a.v);
    return y;
}

/* x is freed. */
static struct map plain_block(struct map x, const char *name, size_t out)
{
    static const char *const norm[] = {"bn1", "bn2", "bn3"};
    static const char *const conv[] = {"conv1", "conv2", "conv3"};
    struct map y = map_make(x.h, x.w, out), in = plain_copy(&x), rest = x;
    size_t at = 0;

    for (size_t k = 0; k < 3; k++) {
        size_t C = k ? out / 4 : out / 2;
        struct map s = plain_step(&in, name, norm[k], conv[k], C, 3);

        map_put(&y, at, &s);
        at += C;
        free(in.v);
        in = s;
    }
    free(in.v);
    if (x.C != out) {
        rest = plain_step(&x, name, "downsample.0", "downsample.2", out, 1);
        free(x.v);
    }
    plain_add(&y, &rest);
    free(rest.v);
    return y;
}

static struct map plain_half(const struct map *x)
{
    struct map y = map_make(x->h / 2, x->w / 2, x->C);

    for (size_t i = 0; i < y.h * y.w * y.C; i++) {
        size_t c = i % y.C, col = i / y.C % y.w * 2, row = i / y.C / y.w * 2;

        for (size_t k = 0; k < 4; k++)
            y.v[i] += 0.25 * x->v[((row + k / 2) * x->w + col + k % 2) * x->C +
                                  c];
    }
    return y;
}

/* Level 4 is the outermost, as the tensors have it.  x is freed. */
static struct map plain_level(struct map x, size_t stack, int level)
{
    struct map low = plain_half(&x), y;
    char buf[120];

    low = plain_block(low, nn_name(buf, "m%zu.b2_%d", stack, level), WIDTH);
    low = level > 1 ? plain_level(low, stack, level - 1)
                    : plain_block(low, nn_name(buf, "m%zu.b2_plus_1", stack),
                                  WIDTH);
    low = plain_block(low, nn_name(buf, "m%zu.b3_%d", stack, level), WIDTH);
    y = plain_block(x, nn_name(buf, "m%zu.b1_%d", stack, level), WIDTH);
    for (size_t i = 0; i < y.h * y.w * y.C; i++) {
        size_t col = i / y.C % y.w / 2, row = i / y.C / y.w / 2;

        y.v[i] += low.v[(row * low.w + col) * y.C + i % y.C];
    }
    free(low.v);
    return y;
}

static struct map plain_mix(const struct map *x, const char *name,
                            size_t stack, size_t out)
{
    char buf[120];

    return plain_conv(x, nn_name(buf, "%s%zu", name, stack), out, 1, 1);
}

/* One stack: heat maps of x, which becomes the next one's. */
static struct map plain_stack(struct map *x, size_t k)
{
    char buf[120];
    struct map y = plain_level(plain_copy(x), k, 4), f, heat;

    y = plain_block(y, nn_name(buf, "top_m_%zu", k), WIDTH);
    f = plain_mix(&y, "conv_last", k, WIDTH);
    plain_norm_relu(&f, nn_name(buf, "bn_end%zu", k));
    heat = plain_mix(&f, "l", k, FAN_LANDMARKS);
    free(y.v);
    if (k + 1 < STACKS) {
        struct map again = plain_mix(&f, "bl", k, WIDTH);
        struct map found = plain_mix(&heat, "al", k, WIDTH);

        plain_add(x, &again);
        plain_add(x, &found);
        free(again.v);
        free(found.v);
    }
    free(f.v);
    return heat;
}

static struct map plain_net(const struct map *rgb)
{
    struct map x = plain_conv(rgb, "conv1", WIDTH / 4, 7, 2), half;
    struct map heat = {0};

    plain_norm_relu(&x, "bn1");
    x = plain_block(x, "conv2", WIDTH / 2);
    half = plain_half(&x);
    free(x.v);
    x = plain_block(half, "conv3", WIDTH / 2);
    x = plain_block(x, "conv4", WIDTH);
    for (size_t k = 0; k < STACKS; k++) {
        free(heat.v);
        heat = plain_stack(&x, k);
    }
    free(x.v);
    return heat;
}

/* For map_gradient_error: heat maps times a probe. */
static double plain_dot(const struct map *rgb, void *probe)
{
    struct map heat = plain_net(rgb);
    double sum = map_dot(&heat, probe);

    free(heat.v);
    return sum;
}

static void check_heat(const float *heat, const struct map *rgb)
{
    struct map truth = plain_net(rgb);

    check_that("sizes", truth.h == SIDE / 4 && truth.C == FAN_LANDMARKS);
    check("heat maps", map_error(heat, &truth), 2e-5);
    free(truth.v);
}

/* Along a random direction of the picture. */
static void check_gradient(struct tape *t, int heat, struct map *rgb,
                           uint64_t seed)
{
    size_t n = SIDE * SIDE * 3, m = SIDE * SIDE / 16 * FAN_LANDMARKS;
    float *probe = noise_make("fan", m, seed, -1, 1);
    float *way = noise_make("fan", n, seed, -1, 1);
    float *d = malloc(n * sizeof *d), *dheat = malloc(m * sizeof *dheat);

    memcpy(dheat, probe, m * sizeof *dheat);
    tape_backward(d, &(struct tape_seed){heat, dheat}, 1, t);
    check("gradient along a direction",
          map_gradient_error(d, rgb, way, plain_dot, probe), 1e-6);
    free(probe);
    free(way);
    free(d);
    free(dheat);
}

/* ---- the loss ----------------------------------------------------------- */

/* Centre of mass within three pixels of map k's largest value; its mass. */
static double plain_centre(double at[2], const struct map *m, size_t k)
{
    size_t max = 0;
    double mass = 0;

    for (size_t i = 0; i < m->h * m->w; i++)
        max = m->v[i * m->C + k] > m->v[max * m->C + k] ? i : max;
    at[0] = at[1] = 0;
    for (size_t i = 0; i < m->h * m->w; i++) {
        double x = (double)(i % m->w), y = (double)(i / m->w);
        double v = fmax(0, m->v[i * m->C + k]);

        if (fabs(x - (double)(max % m->w)) > 3 ||
            fabs(y - (double)(max / m->w)) > 3)
            continue;
        mass += v;
        at[0] += v * x;
        at[1] += v * y;
    }
    at[0] /= fmax(mass, 1e-300);
    at[1] /= fmax(mass, 1e-300);
    return mass;
}

/* Likewise: the distance from a target. */
static double plain_loss(const struct map *rgb, void *target)
{
    struct map a = plain_net(rgb), b = plain_net(target);
    double sum = 0, side = (double)a.h;

    for (size_t k = 0; k < FAN_LANDMARKS; k++) {
        double p[2], q[2];

        if (plain_centre(p, &a, k) > 0 && plain_centre(q, &b, k) > 0)
            sum += (p[0] - q[0]) * (p[0] - q[0]) +
                   (p[1] - q[1]) * (p[1] - q[1]);
    }
    free(a.v);
    free(b.v);
    return sum / (side * side * FAN_LANDMARKS);
}

/* The same through a file, of a whole picture: the square is then the
 * picture itself. */
static void check_loss(const struct params *ps, const float *x,
                       struct map *rgb)
{
    const char *path = folder_at("fan.safetensors"), *meta[] = {NULL};
    const struct square q = {SIDE / 2.0, SIDE / 2.0, SIDE};
    size_t n = SIDE * SIDE * 3;
    struct alignment a;
    struct error err = {0};
    float *y = noise_make("fan", n, 9, 0, 1);
    float *way = noise_make("fan", n, 10, -1, 1);
    float *d = calloc(n, sizeof *d);
    struct map target = map_of(y, SIDE, SIDE, 3);
    double loss;

    check_error("file", !params_save(ps, path, meta, &err) &&
                            !alignment_open(&a, path, SIDE, &err), &err);
    alignment_target(&a, y, SIDE, SIDE, q);
    check_that("no distance from itself",
               alignment_loss(d, y, SIDE, SIDE, q, 1, &a) < 1e-12);
    memset(d, 0, n * sizeof *d);
    loss = alignment_loss(d, x, SIDE, SIDE, q, 0.5, &a);
    check("loss", fabs(2 * loss / plain_loss(rgb, &target) - 1), 1e-5);
    for (size_t i = 0; i < n; i++)
        d[i] *= 2;
    check("gradient of the loss along a direction",
          map_gradient_error(d, rgb, way, plain_loss, &target), 1e-5);
    alignment_release(&a);
    check_that("a side that cannot be halved so often is refused",
               alignment_open(&a, path, 96, &err) != 0);
    free(target.v);
    free(y);
    free(way);
    free(d);
}

/* Random weights; the norms' too, or they would do nothing. */
static void fan_fill(struct params *ps)
{
    params_randomise(ps, 5);
    for (size_t t = 0; t < ps->count; t++) {
        const char *name = ps->tensor[t].name;
        bool var = strstr(name, "running_var") != NULL;
        bool mean = strstr(name, "running_mean") != NULL;
        bool bias = strstr(name, ".bias") != NULL;
        float *noise = noise_make("fan", ps->tensor[t].count, t,
                                  var ? 0.5 : -0.3, var ? 1.5 : 0.3);

        for (size_t i = 0; i < ps->tensor[t].count && (var || mean || bias);
             i++)
            param_w(ps, t)[i] = noise[i];
        free(noise);
    }
}

int main(void)
{
    const struct nn_options opt = {NN_FROZEN, NN_F32};
    struct error err = {0};
    struct params ps;
    struct tape t;

    params_init(&ps);
    tape_init(&t, &ps, 3, true);
    const int heat = fan_declare(&t, STACKS, WIDTH);

    if (params_allocate(&ps, &err))
        return 1;
    fan_fill(&ps);
    weights = &ps;
    for (size_t i = 0; i < ps.count; i++)
        if (!ps.tensor[i].frozen)
            check_that(ps.tensor[i].name, false);
    check_error("plan", !tape_plan(&t, 1, SIDE, SIDE, opt, &err), &err);
    float *x = noise_make("fan", SIDE * SIDE * 3, 4, 0, 1);
    struct map rgb = map_of(x, SIDE, SIDE, 3);
    tape_forward(NULL, x, &t);
    check_heat(tape_map(NULL, &t, heat), &rgb);
    check_gradient(&t, heat, &rgb, 30);
    check_gradient(&t, heat, &rgb, 31);
    folder_make();
    check_loss(&ps, x, &rgb);
    check_that("the folder goes", !folder_remove());
    free(x);
    free(rgb.v);
    tape_release(&t);
    params_release(&ps);
    return check_status();
}
