#include "lib/avatar/model.h"

#include <string.h>
#include <sysexits.h>

#include "lib/track/encoders.h"

int avatar_model_open(struct avatar_model *m, const char *path,
                      const struct head *h, unsigned without,
                      enum nn_type type, struct error *err)
{
    const struct nn_options opt = {NN_INFER, type};
    int rc = -1;

    memset(m, 0, sizeof *m);
    params_init(&m->ps);
    struct safetensors *st = st_open(path, err);
    if (!st)
        return -1;
    if (model_config(&m->config, st, err))
        goto out;
    if (avatar_init(&m->avatar, &m->ps, &m->config, h, err)) {
        error_prefix(err, "%s", path);
        goto out;
    }
    m->avatar.without = without;
    if (params_allocate(&m->ps, err) || params_load(&m->ps, st, "", err) ||
        avatar_plan(&m->avatar, opt, err))
        goto out;
    model_hash(m->hash, st);
    rc = 0;
out:
    st_close(st);
    if (rc)
        avatar_model_release(m);
    return rc;
}

void avatar_model_release(struct avatar_model *m)
{
    avatar_release(&m->avatar);
    params_release(&m->ps);
    memset(m, 0, sizeof *m);
}

int avatar_model_bake(struct avatar_model *m, float *verts,
                      const struct person *p, struct error *err)
{
    struct identity id;
    float cam[12];

    if (!p->rgb || !p->has_source)
        return error_set(err, EX_DATAERR, "identity has no %s record "
                         "(expected an identity, as spid-shape writes it)",
                         p->rgb ? "MOTN" : "SRCI");
    if (p->size != m->config.size)
        return error_set(err, EX_DATAERR, "source picture is %zu pixels wide "
                         "(expected %zu, the model's)", p->size,
                         m->config.size);
    if (p->model[0] && strcmp(p->model, m->hash))
        return error_set(err, EX_DATAERR, "identity was made with model %s "
                         "(expected %s, the model in use)", p->model,
                         m->hash);
    if (person_fold(&id, m->avatar.head, p, err))
        return -1;
    head_pose(verts, &id, &p->source.pose);
    identity_release(&id);
    motion_camera(cam, &p->source);
    struct avatar_source src = {p->rgb, p->matte, verts, cam};
    avatar_bake(&m->avatar, &src);
    return 0;
}
