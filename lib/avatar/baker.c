/* Phase A (Section 3.2): beta and the source's motion pose the head, the
 * branches read the picture through the posed mesh and its camera. */
#include "lib/avatar/baker.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/photo/texture.h"

/* Declare the networks. */
static int baker_declare(struct baker *b, const struct baker_options *opt,
                         struct error *err)
{
    const enum model_system system = b->config.system;

    if (system == SYSTEM_SPID) {
        int rc = avatar_init(&b->avatar, &b->ps, &b->config, b->head, err);

        b->avatar.without |= opt->without;
        b->avatar.colors = opt->colors;
        return rc;
    }
    if (opt->without)
        return error_set(err, EX_USAGE, "a %s has none of SpiD's parts to "
                         "leave out (expected no --without)",
                         system == SYSTEM_LAM ? "lam" : "gagavatar");
    if (model_check_head(&b->config, b->head, err))
        return -1;
    return system == SYSTEM_LAM
               ? lam_init(&b->lam, &b->ps, &b->config, err)
               : gagavatar_init(&b->gagavatar, &b->ps, &b->config, b->head->V,
                                err);
}

/* Room for one source. */
static int baker_plan(struct baker *b, enum nn_type type, struct error *err)
{
    switch (b->config.system) {
    case SYSTEM_GAGAVATAR:
        return gagavatar_plan(&b->gagavatar, type, err);
    case SYSTEM_LAM:
        return lam_plan(&b->lam, b->head->V, type, err);
    default:
        return avatar_plan(&b->avatar, (struct nn_options){NN_INFER, type},
                           err);
    }
}

int baker_open(struct baker *b, const struct model *m, const struct head *h,
               const struct baker_options *opt, struct error *err)
{
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
        baker_plan(b, opt->type, err))
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
    lam_release(&b->lam);
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

        if (own < size || own > PERSON_MAX)
            return error_set(err, EX_DATAERR, "source picture is %zu pixels "
                             "wide (expected %zu to %d)", own, size,
                             PERSON_MAX);
    }
    if (p->model[0] && strcmp(p->model, b->hash))
        return error_set(err, EX_DATAERR, "identity was made with model %s "
                         "(expected %s, the model in use)", p->model,
                         b->hash);
    return 0;
}

/* The person over a grey, in [0,1]; the caller frees.  NULL and *err. */
static float *baker_picture(const struct baker *b,
                            const struct avatar_source *s, float grey,
                            struct error *err)
{
    const size_t n = 3 * b->config.size * b->config.size;
    float *picture = malloc(n * sizeof *picture);

    if (!picture)
        error_set(err, EX_OSERR, "no memory for the source picture");
    for (size_t i = 0; picture && i < n; i++) {
        const float share = s->matte ? (float)s->matte[i / 3] / 255 : 1;

        picture[i] = (float)s->rgb[i] / 255 * share + grey * (1 - share);
    }
    return picture;
}

/* Through GAGAvatar's networks, over black. */
static int baker_bake_gagavatar(struct baker *b, const struct avatar_source *s,
                                struct error *err)
{
    float *picture = baker_picture(b, s, 0, err);

    if (!picture)
        return -1;
    gagavatar_bake(&b->gagavatar, picture, s->cam, s->verts);
    free(picture);
    return 0;
}

/* Through LAM's, over white: the person's offset, and the centres of the
 * source's pose with it. */
static int baker_bake_lam(struct baker *b, const struct avatar_source *s,
                          struct person *p, struct error *err)
{
    struct head_motion pose = p->source.pose;
    float *picture = baker_picture(b, s, 1, err);
    struct identity id;

    if (!picture)
        return -1;
    lam_bake(&b->lam, picture, s->rest, b->head->scale);
    free(picture);
    p->noffset = b->head->V;
    if (person_copy(&p->offset, b->lam.offset, 3 * p->noffset, err) ||
        person_fold(&id, b->head, p, err))
        return -1;
    pose.exp = p->source.exp;
    head_pose(b->lam.mean, &id, &pose);
    identity_release(&id);
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

/* The mesh of id as p's picture shows it. */
static void baker_view_pose(struct baker_view *v, const struct person *p,
                            const struct identity *id)
{
    struct head_motion pose = p->source.pose;

    pose.exp = p->source.exp;
    head_pose(v->verts, id, &pose);
    identity_rest(v->rest, id);
}

/* The picture of p at the model's size, and the mesh of id on it. */
static int baker_view_init(struct baker_view *v, struct avatar_source *out,
                           const struct baker *b, const struct person *p,
                           const struct identity *id, struct error *err)
{
    const size_t size = b->config.size, n = size * size;
    const size_t mesh = 3 * b->head->V * sizeof(float);

    memset(v, 0, sizeof *v);
    v->own = malloc(3 * n);
    v->verts = malloc(mesh);
    v->rest = malloc(mesh);
    if (!v->own || !v->verts || !v->rest)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    baker_view_pose(v, p, id);
    motion_camera(v->cam, &p->source);
    if (p->size != size && person_resize(&v->small, p, size, err))
        return -1;
    const struct person *at = p->size == size ? p : &v->small;

    if (at->back)
        texture_straight(v->own, at->rgb, at->matte, at->back, n);
    else
        memcpy(v->own, at->rgb, 3 * n);
    *out = (struct avatar_source){
        .rgb = v->own, .matte = at->matte,
        .certain = at->confidence, .verts = v->verts, .cam = v->cam,
        .light = p->source.lit ? p->source.light : NULL, .rest = v->rest
    };
    return 0;
}

/* Through SpiD's, once hidden hair stands off the meshes of view: the person's
 * offset. */
static int baker_bake_spid(struct baker *b, const struct avatar_source *s,
                           struct baker_view *view, struct person *p,
                           struct error *err)
{
    struct identity id;

    p->noffset = b->head->V;
    p->offset = malloc(3 * p->noffset * sizeof *p->offset);
    if (!p->offset)
        return error_set(err, EX_OSERR, "no memory for a relief");
    avatar_relief(p->offset, &b->avatar, s);
    if (person_fold(&id, b->head, p, err))
        return -1;
    for (size_t k = 0; k <= p->nmore; k++)
        baker_view_pose(view + k, k ? p->more + k - 1 : p, &id);
    identity_release(&id);
    avatar_bake(&b->avatar, s);
    return 0;
}

/* Through the system's networks. */
static int baker_run(struct baker *b, const struct avatar_source *s,
                     struct baker_view *view, struct person *p, struct error *err)
{
    switch (b->config.system) {
    case SYSTEM_GAGAVATAR:
        return baker_bake_gagavatar(b, s, err);
    case SYSTEM_LAM:
        return baker_bake_lam(b, s, p, err);
    default:
        return baker_bake_spid(b, s, view, p, err);
    }
}

int baker_bake(struct baker *b, float *verts, struct person *p,
               struct error *err)
{
    struct baker_view view[PERSON_MORE + 1] = {0};
    struct avatar_source source[PERSON_MORE + 1];
    struct identity id;
    size_t n = 0;
    int rc = 0;

    free(p->offset);            /* of another bake */
    p->offset = NULL;
    p->noffset = 0;
    if (baker_check(b, p, err) || person_fold(&id, b->head, p, err))
        return -1;
    for (; n <= p->nmore && rc == 0; n++)
        rc = baker_view_init(view + n, source + n, b, n ? p->more + n - 1 : p,
                             &id, err);
    identity_release(&id);
    source->more = source + 1;
    source->nmore = p->nmore;
    if (rc == 0)
        rc = baker_run(b, source, view, p, err);
    if (rc == 0)
        memcpy(verts, view->verts, 3 * b->head->V * sizeof *verts);
    while (n > 0)
        baker_view_release(view + --n);
    return rc;
}

int baker_copy(struct baked *out, struct baker *b, bool drawn,
               struct error *err)
{
    const struct gaussians *set = &b->lam.set;

    if (b->config.system == SYSTEM_SPID)
        return baked_from_avatar(out, &b->avatar, drawn, err);
    if (b->config.system == SYSTEM_LAM)
        return baked_from_set(out, set, set->n, NULL, err);
    if (baked_from_set(out, &b->gagavatar.set, b->gagavatar.V, NULL, err))
        return -1;
    gagavatar_unit_rotations(out->scale, out->quat, out->N);
    return 0;
}
