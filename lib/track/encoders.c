/* The two encoders of Section 3.1 and the matte network as programs use them:
 * weights from a model file, planned for inference on a batch of one. */
#include "lib/track/encoders.h"

#include <string.h>

/* E_m, with its confidence head and what it says of calm faces where the model has
 * them. */
static int encoders_init_motion(struct encoders *e, const struct model *m,
                                struct error *err)
{
    if (motion_encoder_init(&e->motion, &e->ps, "motion.",
                            m->config.motion_net, err))
        return -1;
    if (m->st && st_find(m->st, "motion.sure.weight"))
        motion_encoder_add_confidence(&e->motion, "motion.");
    if (m->st && st_find(m->st, "motion.rest"))
        motion_encoder_add_rest(&e->motion, "motion.");
    return 0;
}

/* The matte network, where the model has one; its first convolution sees 12
 * channels and has two outputs for each of its width. */
static void encoders_init_matte(struct encoders *e, const struct model *m)
{
    const struct st_tensor *first =
        m->st ? st_find(m->st, "matte.down.0.weight") : NULL;

    e->has_matte = first && first->ndim == 4 && first->dim[0] >= 2 &&
                   first->dim[0] <= 128;
    if (e->has_matte)
        matte_net_init(&e->matte, &e->ps, "matte.", MATTE_SIDE,
                       first->dim[0] / 2);
}

int encoders_open(struct encoders *e, const struct model *m, bool with_shape,
                  enum nn_type type, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    const struct avatar_config *c = &m->config;

    memset(e, 0, sizeof *e);
    params_init(&e->ps);
    if (with_shape)
        encoders_init_matte(e, m);
    if (m->st && st_find(m->st, "light.slope.weight"))
        light_net_init(&e->light, &e->ps);
    if (encoders_init_motion(e, m, err) ||
        (with_shape && shape_encoder_init(&e->shape, &e->ps, "shape.",
                                          c->shape_net, err)) ||
        params_allocate(&e->ps, err) || model_load(&e->ps, m, "", err) ||
        (with_shape && shape_encoder_plan(&e->shape, 1, opt, err)) ||
        (e->has_matte && matte_net_plan(&e->matte, 1, opt, err))) {
        encoders_release(e);
        return -1;
    }
    nn_plan_init(&e->motion.plan, opt);
    return 0;
}

void encoders_release(struct encoders *e)
{
    motion_encoder_release(&e->motion);
    shape_encoder_release(&e->shape);
    matte_net_release(&e->matte);
    params_release(&e->ps);
    memset(e, 0, sizeof *e);
}
