/* Phase A (Section 3.2): beta and the source's motion pose the head, the
 * branches read the picture through the posed mesh and its camera. */
#include "lib/avatar/baker.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/photo/texture.h"

/* Whether it is GAGAvatar's. */
static bool baker_is_gagavatar(const struct baker *b)
{
    return b->config.system == SYSTEM_GAGAVATAR;
}

/* Declare the networks. */
static int baker_declare(struct baker *b, const struct baker_options *opt,
                         struct error *err)
{
    if (!baker_is_gagavatar(b)) {
        int rc = avatar_init(&b->avatar, &b->ps, &b->config, b->head, err);

        b->avatar.without = opt->without;
        b->avatar.colors = opt->colors;
        return rc;
    }
    if (opt->without)
        return error_set(err, EX_USAGE, "a gagavatar has none of SpiD's parts "
                         "to leave out (expected no --without)");
    return model_check_head(&b->config, b->head, err) ||
                   gagavatar_init(&b->gagavatar, &b->ps, &b->config,
                                  b->head->V, err)
               ? -1
               : 0;
}

int baker_open(struct baker *b, const struct model *m, const struct head *h,
               const struct baker_options *opt, struct error *err)
{
    const struct nn_options run = {NN_INFER, opt->type};

    memset(b, 0, sizeof *b);
    params_init(&b->ps);
    memcpy(b->hash, m->hash, sizeof b->hash);
    b->config = m->config;
    b->head = h;
    if (baker_declare(b, opt, err)) {
        error_prefix(err, "%s", model_path(m));
        goto fail;
    }
    if (params_allocate(&b->ps, err) || model_load(&b->ps, m, "", err) ||
        (baker_is_gagavatar(b) ? gagavatar_plan(&b->gagavatar, run.type, err)
                               : avatar_plan(&b->avatar, run, err)))
        goto fail;
    return 0;
fail:
    baker_release(b);
    return -1;
}

void baker_release(struct baker *b)
{
    avatar_release(&b->avatar);
    gagavatar_release(&b->gagavatar);
    params_release(&b->ps);
    memset(b, 0, sizeof *b);
}

/* Whether the person is complete and fits the model. */
static int baker_check(const struct baker *b, const struct person *p,
                       struct error *err)
{
    const size_t size = b->config.size;

    if (!p->rgb || !p->has_source)
        return error_set(err, EX_DATAERR, "identity has no %s record "
                         "(expected an identity, as spid-shape writes it)",
                         p->rgb ? RECORD_MOTN : RECORD_SRCI);
    if (p->size < size || p->size > PERSON_LARGEST)
        return error_set(err, EX_DATAERR, "source picture is %zu pixels wide "
                         "(expected %zu to %d)", p->size, size,
                         PERSON_LARGEST);
    if (p->model[0] && strcmp(p->model, b->hash))
        return error_set(err, EX_DATAERR, "identity was made with model %s "
                         "(expected %s, the model in use)", p->model,
                         b->hash);
    return 0;
}

/* The person over black, in [0,1], through GAGAvatar's networks. */
static int baker_bake_gagavatar(struct baker *b, const uint8_t *rgb,
                                const uint8_t *matte, const float *verts,
                                const float cam[12], struct error *err)
{
    const size_t n = 3 * b->config.size * b->config.size;
    float *picture = malloc(n * sizeof *picture);

    if (!picture)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    for (size_t i = 0; i < n; i++)
        picture[i] = (float)rgb[i] / 255 *
                     (matte ? (float)matte[i / 3] / 255 : 1);
    gagavatar_bake(&b->gagavatar, picture, cam, verts);
    free(picture);
    return 0;
}

/* The picture of p, of the model's size, through the posed mesh. */
static int baker_read_picture(struct baker *b, const struct person *p,
                              const float *verts, const float *rest,
                              const float cam[12], struct error *err)
{
    const size_t n = p->size * p->size;
    uint8_t *own = malloc(3 * n);
    int rc = 0;

    if (!own)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    if (p->back)
        texture_straight(own, p->rgb, p->matte, p->back, n);
    else
        memcpy(own, p->rgb, 3 * n);
    if (baker_is_gagavatar(b))
        rc = baker_bake_gagavatar(b, own, p->matte, verts, cam, err);
    else
        avatar_bake(&b->avatar, &(struct avatar_source){
            .rgb = own, .matte = p->matte, .verts = verts, .cam = cam,
            .rest = rest
        });
    free(own);
    return rc;
}

int baker_bake(struct baker *b, float *verts, const struct person *p,
               struct error *err)
{
    const size_t size = b->config.size;
    struct person small = {0};
    struct identity id;
    float cam[12], *rest = malloc(3 * b->head->V * sizeof *rest);
    int rc;

    if (!rest)
        return error_set(err, EX_OSERR, "no memory for %zu vertices",
                         b->head->V);
    if (baker_check(b, p, err) || person_fold(&id, b->head, p, err)) {
        free(rest);
        return -1;
    }
    head_pose(verts, &id, &p->source.pose);
    identity_rest(rest, &id);
    identity_release(&id);
    motion_camera(cam, &p->source);
    if (p->size == size)
        rc = baker_read_picture(b, p, verts, rest, cam, err);
    else
        rc = person_resize(&small, p, size, err) ||
             baker_read_picture(b, &small, verts, rest, cam, err) ? -1 : 0;
    person_release(&small);
    free(rest);
    return rc;
}

int baker_copy(struct baked *out, struct baker *b, bool drawn,
               struct error *err)
{
    if (!baker_is_gagavatar(b))
        return baked_from_avatar(out, &b->avatar, drawn, err);
    if (baked_from_set(out, &b->gagavatar.set, b->gagavatar.V, NULL, err))
        return -1;
    gagavatar_unit_rotations(out->scale, out->quat, out->N);
    return 0;
}
