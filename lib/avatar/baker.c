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
    for (size_t k = 0; k <= p->nmore; k++) {
        const size_t own = k ? p->more[k - 1].size : p->size;

        if (own < size || own > PERSON_LARGEST)
            return error_set(err, EX_DATAERR, "source picture is %zu pixels "
                             "wide (expected %zu to %d)", own, size,
                             PERSON_LARGEST);
    }
    if (p->model[0] && strcmp(p->model, b->hash))
        return error_set(err, EX_DATAERR, "identity was made with model %s "
                         "(expected %s, the model in use)", p->model,
                         b->hash);
    return 0;
}

/* The person over black, in [0,1], through GAGAvatar's networks. */
static int baker_bake_gagavatar(struct baker *b, const struct avatar_source *s,
                                struct error *err)
{
    const size_t n = 3 * b->config.size * b->config.size;
    float *picture = malloc(n * sizeof *picture);

    if (!picture)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    for (size_t i = 0; i < n; i++)
        picture[i] = (float)s->rgb[i] / 255 *
                     (s->matte ? (float)s->matte[i / 3] / 255 : 1);
    gagavatar_bake(&b->gagavatar, picture, s->cam, s->verts);
    free(picture);
    return 0;
}

/* A picture as the branches take it, and what they borrow. */
struct baker_view {
    struct person small;        /* of the model's size */
    uint8_t *own;               /* (S,S,3) the person's colours alone */
    float *verts, *rest;        /* (V,3) */
    float cam[12];
};

static void baker_view_release(struct baker_view *v)
{
    person_release(&v->small);
    free(v->own);
    free(v->verts);
    free(v->rest);
}

/* The picture of p at the model's size, and the mesh of id on it. */
static int baker_view_init(struct baker_view *v, struct avatar_source *out,
                           const struct baker *b, const struct person *p,
                           const struct identity *id, struct error *err)
{
    const size_t size = b->config.size, n = size * size;
    const size_t mesh = 3 * b->head->V * sizeof(float);
    struct head_motion pose = p->source.pose;

    memset(v, 0, sizeof *v);
    v->own = malloc(3 * n);
    v->verts = malloc(mesh);
    v->rest = malloc(mesh);
    if (!v->own || !v->verts || !v->rest)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    pose.exp = p->source.exp;
    head_pose(v->verts, id, &pose);
    identity_rest(v->rest, id);
    motion_camera(v->cam, &p->source);
    if (p->size != size && person_resize(&v->small, p, size, err))
        return -1;
    const struct person *at = p->size == size ? p : &v->small;

    if (at->back)
        texture_straight(v->own, at->rgb, at->matte, at->back, n);
    else
        memcpy(v->own, at->rgb, 3 * n);
    *out = (struct avatar_source){
        .rgb = v->own, .matte = at->matte, .verts = v->verts, .cam = v->cam,
        .light = p->source.lit ? p->source.light : NULL, .rest = v->rest
    };
    return 0;
}

int baker_bake(struct baker *b, float *verts, const struct person *p,
               struct error *err)
{
    struct baker_view view[PERSON_MORE + 1] = {0};
    struct avatar_source source[PERSON_MORE + 1];
    struct identity id;
    size_t n = 0;
    int rc = 0;

    if (baker_check(b, p, err) || person_fold(&id, b->head, p, err))
        return -1;
    for (; n <= p->nmore && rc == 0; n++)
        rc = baker_view_init(view + n, source + n, b, n ? p->more + n - 1 : p,
                             &id, err);
    identity_release(&id);
    source->more = source + 1;
    source->nmore = p->nmore;
    if (rc == 0 && baker_is_gagavatar(b))
        rc = baker_bake_gagavatar(b, source, err);
    else if (rc == 0)
        avatar_bake(&b->avatar, source);
    if (rc == 0)
        memcpy(verts, view->verts, 3 * b->head->V * sizeof *verts);
    while (n > 0)
        baker_view_release(view + --n);
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
