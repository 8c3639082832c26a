#include "lib/avatar/records.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"

/* ---- motion ------------------------------------------------------------ */

/* Copy the f32 array name of n numbers (shape d0, or d0 x d1) into out. */
static int take(float *out, const struct record *rec, const char *name,
                size_t d0, size_t d1, struct error *err)
{
    size_t dims[2] = {d0, d1}, n = d0 * (d1 ? d1 : 1);
    const float *x = record_get(rec, name, DTYPE_F32, d1 ? 2 : 1, dims, err);

    if (!x)
        return -1;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return error_set(err, EX_DATAERR, "%s %s[%zu] is %f "
                             "(expected a finite number)",
                             rec->type, name,
                             i, (double)x[i]);
    memcpy(out, x, n * sizeof *out);
    return 0;
}

int motion_read(struct motion *m, const struct record *rec, size_t nexp,
                struct error *err)
{
    memset(m, 0, sizeof *m);
    if (nexp > HEAD_MAX_EXP)
        return error_set(err, EX_DATAERR, "head has %zu expression "
                         "directions (expected at most %d)", nexp,
                         HEAD_MAX_EXP);
    if (take(m->R, rec, "rot", 3, 3, err) ||
        take(m->t, rec, "trans", 3, 0, err) ||
        (nexp && take(m->exp, rec, "exp", nexp, 0, err)) ||
        take(m->pose.jaw, rec, "jaw", 3, 0, err) ||
        take(m->pose.lid, rec, "lid", 2, 0, err) ||
        take(m->pose.eye, rec, "eye", 6, 0, err))
        return -1;
    if (record_find(rec, "crop") && take(m->crop, rec, "crop", 3, 0, err))
        return -1;
    m->pose.exp = m->exp;
    return 0;
}

int motion_write(struct stream_writer *w, uint64_t frame, double time,
                 const struct motion *m, size_t nexp,
                 const struct array *others, int nothers, struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS] = {
        array_make("rot", DTYPE_F32, m->R, 2, 3, 3, 0, 0),
        array_make("trans", DTYPE_F32, m->t, 1, 3, 0, 0, 0),
        array_make("exp", DTYPE_F32, m->exp, 1, nexp, 0, 0, 0),
        array_make("jaw", DTYPE_F32, m->pose.jaw, 1, 3, 0, 0, 0),
        array_make("lid", DTYPE_F32, m->pose.lid, 1, 2, 0, 0, 0),
        array_make("eye", DTYPE_F32, m->pose.eye, 1, 6, 0, 0, 0),
        array_make("crop", DTYPE_F32, m->crop, 1, 3, 0, 0, 0)
    };
    int n = 7;

    for (int i = 0; i < nothers && n < STREAM_MAX_ARRAYS; i++)
        a[n++] = others[i];
    return stream_write(w, "MOTN", frame, time, a, n, err);
}

void motion_camera(float cam[12], const struct motion *m)
{
    camera_make(cam, m->R, m->t);
}

/* ---- mesh -------------------------------------------------------------- */

int mesh_write(struct stream_writer *w, uint64_t frame, double time,
               const struct head *h, const float *verts, const float cam[12],
               int with_faces, const struct array *others, int nothers,
               struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];
    struct head_mouth mouth;
    int n = 0;

    head_mouth(&mouth, h, verts);
    a[n++] = array_make("verts", DTYPE_F32, verts, 2, h->V, 3, 0, 0);
    a[n++] = array_make("cam", DTYPE_F32, cam, 2, 3, 4, 0, 0);
    a[n++] = array_make("lip", DTYPE_F32, mouth.centre, 1, 3, 0, 0, 0);
    a[n++] = array_make("gap", DTYPE_F32, &mouth.gap, 1, 1, 0, 0, 0);
    if (with_faces)
        a[n++] = array_make("faces", DTYPE_I32, h->f, 2, h->F, 3, 0, 0);
    for (int i = 0; i < nothers && n < STREAM_MAX_ARRAYS; i++)
        a[n++] = others[i];
    return stream_write(w, "MESH", frame, time, a, n, err);
}

/* ---- identity ---------------------------------------------------------- */

static void take_hash(char out[17], const cJSON *conf, const char *key)
{
    const cJSON *v = cJSON_GetObjectItem(conf, key);

    if (cJSON_IsString(v))
        snprintf(out, 17, "%s", v->valuestring);
}

static int take_conf(struct person *p, const struct record *rec)
{
    const struct array *a = record_find(rec, "json");

    if (!a || a->dtype != DTYPE_U8)
        return 0;
    cJSON *conf = cJSON_ParseWithLength(a->data, array_bytes(a));
    take_hash(p->head, conf, "head_hash");
    take_hash(p->model, conf, "model_hash");
    cJSON_Delete(conf);
    return 1;
}

static int take_shape(struct person *p, const struct record *rec,
                      struct error *err)
{
    size_t any[1] = {0};
    const float *x = record_get(rec, "shape", DTYPE_F32, 1, any, err);

    if (!x || record_check_finite(rec, err))
        return -1;
    size_t n = array_count(record_find(rec, "shape"));
    float *copy = malloc((n ? n : 1) * sizeof *copy);
    if (!copy)
        return error_set(err, EX_OSERR, "no memory for an identity");
    memcpy(copy, x, n * sizeof *copy);
    free(p->shape);
    p->shape = copy;
    p->nshape = n;
    return 1;
}

static int take_picture(struct person *p, const struct record *rec,
                        struct error *err)
{
    size_t any[3] = {0, 0, 3};
    const uint8_t *rgb = record_get(rec, "rgb", DTYPE_U8, 3, any, err);

    if (!rgb)
        return -1;
    size_t S = record_find(rec, "rgb")->dim[0];
    size_t square[3] = {S, S, 3};
    const uint8_t *matte = record_get(rec, "matte", DTYPE_U8, 2, square, err);
    if (!matte || !record_get(rec, "rgb", DTYPE_U8, 3, square, err) ||
        (record_find(rec, "crop") && take(p->crop, rec, "crop", 3, 0, err)))
        return -1;
    free(p->rgb);
    free(p->matte);
    p->size = S;
    p->rgb = malloc(3 * S * S + 1);
    p->matte = malloc(S * S + 1);
    if (!p->rgb || !p->matte)
        return error_set(err, EX_OSERR, "no memory for the source picture");
    memcpy(p->rgb, rgb, 3 * S * S);
    memcpy(p->matte, matte, S * S);
    return 1;
}

int person_take(struct person *p, const struct record *rec, size_t nexp,
                struct error *err)
{
    if (record_is(rec, "CONF"))
        return take_conf(p, rec);
    if (record_is(rec, "SHAP"))
        return take_shape(p, rec, err);
    if (record_is(rec, "SRCI"))
        return take_picture(p, rec, err);
    if (record_is(rec, "MOTN")) {
        if (motion_read(&p->source, rec, nexp, err))
            return -1;
        p->has_source = 1;
        return 1;
    }
    return 0;
}

int person_load(struct person *p, const char *path, size_t nexp,
                struct error *err)
{
    struct record rec;
    int rc, taken = 0;

    memset(p, 0, sizeof *p);
    struct stream_reader *r = stream_open(path, NULL, err);
    if (!r)
        return -1;
    while ((rc = stream_read(r, &rec, err)) > 0) {
        taken = person_take(p, &rec, nexp, err);
        if (taken < 0) {
            error_prefix(err, "%s", path);
            break;
        }
    }
    if (rc == 0 && !p->shape)
        rc = error_set(err, EX_DATAERR, "%s: no SHAP record (expected an "
                       "identity, as spid-shape writes it)", path);
    stream_close(r);
    if (rc < 0 || taken < 0) {
        person_release(p);
        return -1;
    }
    return 0;
}

void person_release(struct person *p)
{
    free(p->shape);
    free(p->rgb);
    free(p->matte);
    memset(p, 0, sizeof *p);
}

int person_fold(struct identity *id, const struct head *h,
                const struct person *p, struct error *err)
{
    if (p->head[0] && strcmp(p->head, h->hash))
        return error_set(err, EX_DATAERR, "identity belongs to head %s "
                         "(expected %s, the head in use)", p->head, h->hash);
    return head_fold(id, h, p->shape, p->nshape, err);
}
