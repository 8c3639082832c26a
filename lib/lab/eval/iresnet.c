/* ArcFace's IResNet (Deng et al. 2019) for comparing identities in evaluation:
 * inference only, its sizes read from the file. */
#include "lib/lab/eval/iresnet.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/eval/tape_steps.h"

#define STAGES 4
#define BLOCKS_MAX (TAPE_MAPS - 16)  /* maps, of all blocks */

/* As iresnet_declare wants it. */
static size_t iresnet_rows(const void *file, const char *name)
{
    const struct st_tensor *t = st_find(file, name);

    return t && t->ndim ? t->dim[0] : 0;
}

/* Block layerL.B: conv2(prelu(conv1(bn1 x))) + (down x, or x), norms behind
 * the convolutions.  Before a padded one it cannot be folded: the padding is 0
 * after it, not before. */
static int iresnet_block(struct tape *t, int x, const char *name, size_t out,
                         bool down)
{
    char buf[120];
    int y = tape_norm(t, x, nn_name(buf, "%s.bn1", name), NORM_EPS, ACT_NONE);

    y = tape_conv(t, y, nn_name(buf, "%s.conv1", name), out, 3, false);
    tape_fold_norm(t, y, nn_name(buf, "%s.bn2", name), NORM_EPS);
    y = tape_prelu(t, y, nn_name(buf, "%s.prelu.weight", name));
    y = tape_conv(t, y, nn_name(buf, "%s.conv2", name), out, 3, false);
    tape_layer(t, y)->stride = down ? 2 : 1;
    tape_fold_norm(t, y, nn_name(buf, "%s.bn3", name), NORM_EPS);
    if (down) {
        x = tape_conv(t, x, nn_name(buf, "%s.downsample.0", name), out, 1,
                      false);
        tape_layer(t, x)->stride = 2;
        tape_fold_norm(t, x, nn_name(buf, "%s.downsample.1", name), NORM_EPS);
    }
    return tape_add(t, y, x, ACT_NONE);
}

int iresnet_declare(struct iresnet *n,
                    size_t rows(const void *file, const char *name),
                    const void *file, const char *path, struct error *err)
{
    const size_t channels = rows(file, "conv1.weight");
    const size_t code = rows(file, "fc.weight");
    const size_t side = IRESNET_SIDE >> STAGES;
    struct tape *t = &n->tape;
    char name[64], weight[80];
    int x;

    memset(n, 0, sizeof *n);
    params_init(&n->ps);
    tape_init(t, &n->ps, 3, true);
    if (!channels || !code)
        return error_set(err, EX_DATAERR, "%s: no conv1.weight or fc.weight "
                         "(expected an iresnet)", path);
    x = tape_conv(t, 0, "conv1", channels, 3, false);
    tape_fold_norm(t, x, "bn1", NORM_EPS);
    x = tape_prelu(t, x, "prelu.weight");
    for (int stage = 1; stage <= STAGES; stage++)
        for (int i = 0;; i++) {
            snprintf(name, sizeof name, "layer%d.%d", stage, i);
            snprintf(weight, sizeof weight, "%s.conv1.weight", name);
            size_t out = rows(file, weight);

            if (!out && i)
                break;
            if (!out || x > BLOCKS_MAX)
                return error_set(err, EX_DATAERR, "%s: no %s, or too many "
                                 "blocks", path, weight);
            x = iresnet_block(t, x, name, out, i == 0);
        }
    x = tape_norm(t, x, "bn2", NORM_EPS, ACT_NONE);
    x = tape_linear(t, tape_flatten(t, x, side * side), "fc", code);
    n->code = tape_norm(t, x, "features", NORM_EPS, ACT_NONE);
    return 0;
}

int iresnet_open(struct iresnet *n, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = -1;

    memset(n, 0, sizeof *n);
    if (!st)
        return -1;
    if (!iresnet_declare(n, iresnet_rows, st, path, err) &&
        !params_allocate(&n->ps, err) && !params_load(&n->ps, st, "", err))
        rc = tape_plan(&n->tape, 1, IRESNET_SIDE, IRESNET_SIDE,
                       (struct nn_options){NN_INFER, NN_F32}, err);
    st_close(st);
    if (rc)
        iresnet_release(n);
    return rc;
}

void iresnet_release(struct iresnet *n)
{
    tape_release(&n->tape);
    params_release(&n->ps);
    memset(n, 0, sizeof *n);
}

size_t iresnet_size(const struct iresnet *n)
{
    return n->tape.map[n->code]->channels;
}

void iresnet_forward(float *embedding, const float *rgb, struct iresnet *n)
{
    const size_t size = iresnet_size(n);
    const float *code = tape_map(NULL, &n->tape, n->code);
    double sum = 0;

    tape_forward(NULL, rgb, &n->tape);
    for (size_t i = 0; i < size; i++)
        sum += (double)code[i] * (double)code[i];
    for (size_t i = 0; i < size; i++)
        embedding[i] = (float)((double)code[i] / fmax(sqrt(sum), 1e-30));
}
