/* Phase A (Section 3.2): beta and the source's motion pose the head, the
 * branches read the picture through the posed mesh and its camera. */
#include "lib/avatar/baker.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/texture/texture.h"

int baker_open(struct baker *b, const struct model *m, const struct head *h,
               unsigned without, enum nn_type type, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};

    memset(b, 0, sizeof *b);
    params_init(&b->ps);
    memcpy(b->hash, m->hash, sizeof b->hash);
    if (avatar_init(&b->avatar, &b->ps, &m->config, h, err)) {
        error_prefix(err, "%s", model_path(m));
        goto fail;
    }
    b->avatar.without = without;
    if (params_allocate(&b->ps, err) || model_load(&b->ps, m, "", err) ||
        avatar_plan(&b->avatar, opt, err))
        goto fail;
    return 0;
fail:
    baker_release(b);
    return -1;
}

void baker_release(struct baker *b)
{
    avatar_release(&b->avatar);
    params_release(&b->ps);
    memset(b, 0, sizeof *b);
}

/* Whether the person is complete and fits the model. */
static int baker_check(const struct baker *b, const struct person *p,
                       struct error *err)
{
    const size_t size = b->avatar.config.size;

    if (!p->rgb || !p->has_source)
        return error_set(err, EX_DATAERR, "identity has no %s record "
                         "(expected an identity, as spid-shape writes it)",
                         p->rgb ? "MOTN" : "SRCI");
    if (p->size != size)
        return error_set(err, EX_DATAERR, "source picture is %zu pixels wide "
                         "(expected %zu, the model's)", p->size, size);
    if (p->model[0] && strcmp(p->model, b->hash))
        return error_set(err, EX_DATAERR, "identity was made with model %s "
                         "(expected %s, the model in use)", p->model,
                         b->hash);
    return 0;
}

int baker_bake(struct baker *b, float *verts, const struct person *p,
               struct error *err)
{
    struct identity id;
    float cam[12];

    if (baker_check(b, p, err) ||
        person_fold(&id, b->avatar.head, p, err))
        return -1;
    head_pose(verts, &id, &p->source.pose);
    identity_release(&id);
    motion_camera(cam, &p->source);
    uint8_t *own = malloc(3 * p->size * p->size);
    if (!own)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    if (p->back)
        texture_straight(own, p->rgb, p->matte, p->back, p->size * p->size);
    else
        memcpy(own, p->rgb, 3 * p->size * p->size);
    avatar_bake(&b->avatar, &(struct avatar_source){
        .rgb = own, .matte = p->matte, .verts = verts, .cam = cam
    });
    free(own);
    return 0;
}
