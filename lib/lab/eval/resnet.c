/* ResNet-50, a stage at a time. */
#include "lib/lab/eval/resnet.h"

#include "lib/lab/eval/tape_steps.h"

#define STEM ((size_t)64)
#define WIDEN ((size_t)4)       /* channels of a block over those within */

static const int blocks[RESNET_LEVELS] = {0, 3, 4, 6, 3};

/* A convolution without bias, its norm folded in; both names are formats of a
 * block's name and a number. */
static int resnet_conv(struct tape *t, int x, const char *conv,
                       const char *norm, const char *block, int k, size_t out,
                       size_t kernel, size_t stride, enum nn_act act)
{
    char name[120];

    x = tape_conv(t, x, nn_name(name, conv, block, k), out, kernel, false);
    tape_layer(t, x)->stride = stride;
    tape_layer(t, x)->act = act;
    tape_fold_norm(t, x, nn_name(name, norm, block, k), NORM_EPS);
    return x;
}

/* relu(conv3(relu(conv2(relu(conv1 x)))) + (down x, or x)). */
static int resnet_block(struct tape *t, int x, const char *name, int level,
                        bool first)
{
    const size_t narrow = STEM << (level - 1), wide = WIDEN * narrow;
    const size_t stride = first && level > 1 ? 2 : 1;
    int y = x;

    for (int k = 1; k <= 3; k++)
        y = resnet_conv(t, y, "%s.conv%d", "%s.bn%d", name, k,
                        k < 3 ? narrow : wide, k == 2 ? 3 : 1,
                        k == 2 ? stride : 1, k < 3 ? ACT_RELU : ACT_NONE);
    if (first)
        x = resnet_conv(t, x, "%s.downsample.%d", "%s.downsample.1", name, 0,
                        wide, 1, stride, ACT_NONE);
    return tape_add(t, y, x, ACT_RELU);
}

void resnet_declare(int level[RESNET_LEVELS], struct tape *t, const char *at)
{
    char name[120];
    int x = level[0] = resnet_conv(t, 0, "%sconv%d", "%sbn%d", at, 1, STEM, 7,
                                   2, ACT_RELU);

    x = tape_pool(t, x, 1, true);
    for (int i = 1; i < RESNET_LEVELS; i++) {
        for (int b = 0; b < blocks[i]; b++)
            x = resnet_block(t, x, nn_name(name, "%slayer%d.%d", at, i, b), i,
                             b == 0);
        level[i] = x;
    }
    for (int i = 0; i < RESNET_LEVELS; i++)
        tape_keep(t, level[i]);
}
