/* SqueezeNet 1.0's features. */
#include "lib/lab/eval/squeezenet.h"

#include "lib/lab/eval/tape_steps.h"

#define FIRST 96                  /* channels of the first convolution */

/* The fire modules: the index in "features.N", channels squeezed to, channels
 * of each expansion, and whether a pool goes before. */
static const struct {
    size_t index, squeeze, expand;
    bool pooled;
} squeezenet_fires[SQUEEZENET_FIRES] = {
    { 3, 16, 64, true },   { 4, 16, 64, false },  { 5, 32, 128, false },
    { 7, 32, 128, true },  { 8, 48, 192, false }, { 9, 48, 192, false },
    { 10, 64, 256, false }, { 12, 64, 256, true }
};

/* One convolution with ReLU. */
static int squeezenet_conv(struct tape *t, int of, const char *name,
                           size_t out, size_t kernel)
{
    const int x = tape_conv(t, of, name, out, kernel, true);

    tape_layer(t, x)->act = ACT_RELU;
    return x;
}

void squeezenet_declare(int layer[SQUEEZENET_LAYERS], struct tape *t)
{
    char name[120];
    int x = layer[0] = squeezenet_conv(t, 0, "features.0", FIRST, 7);

    tape_layer(t, x)->stride = 2;
    tape_layer(t, x)->pad = CONV_NONE;
    for (size_t i = 0; i < SQUEEZENET_FIRES; i++) {
        const size_t at = squeezenet_fires[i].index;
        const size_t out = squeezenet_fires[i].expand;

        if (squeezenet_fires[i].pooled)
            x = tape_pool(t, x, 0, true);
        x = squeezenet_conv(t, x, nn_name(name, "features.%zu.squeeze", at),
                            squeezenet_fires[i].squeeze, 1);
        const int one = squeezenet_conv(
            t, x, nn_name(name, "features.%zu.expand1x1", at), out, 1);
        const int three = squeezenet_conv(
            t, x, nn_name(name, "features.%zu.expand3x3", at), out, 3);

        x = layer[i + 1] = tape_concat(t, one, three);
    }
}
