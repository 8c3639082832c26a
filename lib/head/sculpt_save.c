#include "lib/head/sculpt.h"

#include "formats/safetensors.h"

static struct st_tensor tensor(const char *name, enum st_dtype type,
                               const void *data, size_t a, size_t b, size_t c)
{
    struct st_tensor t = { .name = name, .dtype = type, .data = data,
                           .ndim = c ? 3 : b ? 2 : 1, .dim = { a, b, c } };
    t.count = a * (b ? b : 1) * (c ? c : 1);
    return t;
}

void sculpt_arrays(struct head_arrays *a, const struct sculpt *s)
{
    *a = (struct head_arrays){
        .V = s->nv, .F = s->nf, .nshape = SCULPT_SHAPES,
        .nexp = SCULPT_EXPRESSIONS, .v_template = s->v_template, .f = s->f,
        .shapedirs = s->shapedirs, .posedirs = s->posedirs,
        .J_regressor = s->j_regressor, .weights = s->weights,
        .parents = s->parents, .l_eyelid = s->l_eyelid,
        .r_eyelid = s->r_eyelid, .lip_inner = s->lip_inner,
        .lip_upper_outer = s->lip_upper_outer,
        .nlip_inner = s->n_lip_inner,
        .nlip_upper_outer = s->n_lip_upper_outer,
        .landmark_faces = s->landmark_face,
        .landmark_bary = s->landmark_bary, .region = s->region,
        .hair = s->hair, .uv = s->uv,
    };
}

int sculpt_save(const struct sculpt *s, const char *path, struct error *err)
{
    static const char *const meta[] = { "format", "spid-head", "scale", "5",
        "nshape", "300", "unit", "metre", NULL };
    size_t V = s->nv;
    const struct st_tensor t[] = {
        tensor("v_template", ST_F32, s->v_template, V, 3, 0),
        tensor("f", ST_I32, s->f, s->nf, 3, 0),
        tensor("shapedirs", ST_F32, s->shapedirs, V, 3,
               SCULPT_SHAPES + SCULPT_EXPRESSIONS),
        tensor("posedirs", ST_F32, s->posedirs, V, 3, SCULPT_POSES),
        tensor("J_regressor", ST_F32, s->j_regressor, SCULPT_JOINTS, V, 0),
        tensor("weights", ST_F32, s->weights, V, SCULPT_JOINTS, 0),
        tensor("parents", ST_I32, s->parents, SCULPT_JOINTS, 0, 0),
        tensor("l_eyelid", ST_F32, s->l_eyelid, V, 3, 0),
        tensor("r_eyelid", ST_F32, s->r_eyelid, V, 3, 0),
        tensor("lip_inner", ST_I32, s->lip_inner, s->n_lip_inner, 0, 0),
        tensor("lip_upper_outer", ST_I32, s->lip_upper_outer,
               s->n_lip_upper_outer, 0, 0),
        tensor("landmark_faces", ST_I32, s->landmark_face, SCULPT_LANDMARKS,
               0, 0),
        tensor("landmark_bary", ST_F32, s->landmark_bary, SCULPT_LANDMARKS, 3,
               0),
        tensor("region", ST_I32, s->region, V, 0, 0),
        tensor("hair", ST_F32, s->hair, V, 0, 0),
        tensor("uv", ST_F32, s->uv, V, 2, 0),
    };
    return st_save(path, t, sizeof t / sizeof *t, meta, err);
}
