/* FAN, from the inside out. */
#include "lib/lab/train/fan.h"

#include <stdio.h>
#include <sysexits.h>

#include "lib/lab/eval/tape_steps.h"

#define LEVELS 4              /* an hourglass halves its maps so often */

int fan_size(size_t *stacks, size_t *width, const struct safetensors *st,
             struct error *err)
{
    const struct st_tensor *t = NULL;
    char name[40];

    for (*stacks = 0; *stacks < FAN_STACKS; ++*stacks) {
        snprintf(name, sizeof name, "m%zu.b1_4.bn1.weight", *stacks);
        if (!st_find(st, name))
            break;
        t = st_find(st, name);
    }
    if (!t || t->ndim != 1 || !t->dim[0] || t->dim[0] % 16 ||
        t->dim[0] > FAN_WIDTH_MAX)
        return error_set(err, EX_DATAERR, "%s: no m0.b1_4.bn1.weight of a "
                         "multiple of 16 (expected a face alignment network, "
                         "spid-import --as fan)", st_path(st));
    *width = t->dim[0];
    return 0;
}

/* conv(relu(norm x)) */
static int fan_step(struct tape *t, int x, const char *norm, const char *conv,
                    size_t out, size_t kernel)
{
    return tape_conv(t, tape_norm(t, x, norm, NORM_EPS, ACT_RELU), conv, out,
                     kernel, false);
}

/* [s0(x), s1(s0), s2(s1)] + x, or where channels change + wide(x): steps of a
 * half, a quarter and a quarter of the channels. */
static int fan_block(struct tape *t, int x, const char *name, size_t out)
{
    const bool widens = t->map[x]->channels != out;
    char norm[120], conv[120];
    int s[3], at = x;

    for (int i = 0; i < 3; i++)
        at = s[i] = fan_step(t, at, nn_name(norm, "%s.bn%d", name, i + 1),
                             nn_name(conv, "%s.conv%d", name, i + 1),
                             i ? out / 4 : out / 2, 3);
    const int y = tape_concat(t, s[0], tape_concat(t, s[1], s[2]));

    if (widens)
        x = fan_step(t, x, nn_name(norm, "%s.downsample.0", name),
                     nn_name(conv, "%s.downsample.2", name), out, 1);
    return tape_add(t, y, x, ACT_NONE);
}

/* outer(x) + twice as large back(inner(down(x halved))), inner the next level,
 * at the last a block; theirs count from inside. */
static int fan_level(struct tape *t, int x, size_t stack, int level)
{
    const size_t W = t->map[x]->channels;
    char name[120];
    int y = fan_block(t, tape_halve(t, x),
                      nn_name(name, "m%zu.b2_%d", stack, level), W);

    y = level > 1 ? fan_level(t, y, stack, level - 1)
                  : fan_block(t, y, nn_name(name, "m%zu.b2_plus_1", stack), W);
    y = fan_block(t, y, nn_name(name, "m%zu.b3_%d", stack, level), W);
    x = fan_block(t, x, nn_name(name, "m%zu.b1_%d", stack, level), W);
    return tape_add(t, x, tape_double(t, y), ACT_NONE);
}

/* A 1x1 convolution with bias. */
static int fan_mix(struct tape *t, int x, const char *name, size_t stack,
                   size_t out)
{
    char buf[120];

    return tape_conv(t, x, nn_name(buf, "%s%zu", name, stack), out, 1, true);
}

/* *heat of x; what the next stack sees, if there is one:
 * x + again(features) + found(heat). */
static int fan_stack(int *heat, struct tape *t, int x, size_t k, bool last)
{
    const size_t W = t->map[x]->channels;
    char name[120];
    int y = fan_block(t, fan_level(t, x, k, LEVELS),
                      nn_name(name, "top_m_%zu", k), W);

    y = fan_mix(t, y, "conv_last", k, W);
    tape_fold_norm(t, y, nn_name(name, "bn_end%zu", k), NORM_EPS);
    tape_layer(t, y)->act = ACT_RELU;
    *heat = fan_mix(t, y, "l", k, FAN_LANDMARKS);
    if (last)
        return x;
    x = tape_add(t, x, fan_mix(t, y, "bl", k, W), ACT_NONE);
    return tape_add(t, x, fan_mix(t, *heat, "al", k, W), ACT_NONE);
}

int fan_declare(struct tape *t, size_t stacks, size_t width)
{
    int x = tape_conv(t, 0, "conv1", width / 4, 7, true), heat = x;

    tape_layer(t, x)->stride = 2;
    tape_layer(t, x)->act = ACT_RELU;
    tape_fold_norm(t, x, "bn1", NORM_EPS);
    x = tape_halve(t, fan_block(t, x, "conv2", width / 2));
    x = fan_block(t, x, "conv3", width / 2);
    x = fan_block(t, x, "conv4", width);
    for (size_t k = 0; k < stacks; k++)
        x = fan_stack(&heat, t, x, k, k + 1 == stacks);
    return heat;
}
