/* Reading and writing MOTN: rotation and translation of the camera (Eq. T_d),
 * expression, jaw, lids and eyes of the head. */
#include "lib/head/motion.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"

/* Copy the f32 array name of n numbers (shape d0, or d0 x d1) into out. */
static int motion_copy(float *out, const struct record *rec, const char *name,
                       size_t d0, size_t d1, struct error *err)
{
    size_t dims[2] = {d0, d1}, n = d0 * (d1 ? d1 : 1);
    const float *x = record_get(rec, name, DTYPE_F32, d1 ? 2 : 1, dims, err);

    if (!x)
        return -1;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return error_set(err, EX_DATAERR, "%s %s[%zu] is %f "
                             "(expected a finite number)", rec->type, name,
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
    if (motion_copy(m->R, rec, "rot", 3, 3, err) ||
        motion_copy(m->t, rec, "trans", 3, 0, err) ||
        (nexp && motion_copy(m->exp, rec, "exp", nexp, 0, err)) ||
        motion_copy(m->pose.jaw, rec, "jaw", 3, 0, err) ||
        motion_copy(m->pose.lid, rec, "lid", 2, 0, err) ||
        motion_copy(m->pose.eye, rec, "eye", 6, 0, err))
        return -1;
    if (record_find(rec, "crop") &&
        motion_copy(m->crop, rec, "crop", 3, 0, err))
        return -1;
    m->lit = record_find(rec, "light") != NULL;
    if (m->lit && motion_copy(m->light, rec, "light", 3, 0, err))
        return -1;
    m->pose.exp = m->exp;
    return 0;
}

size_t motion_expressions(const struct record *rec)
{
    const struct array *exp = record_find(rec, "exp");

    return exp && exp->ndim == 1 ? exp->dim[0] : 0;
}

int motion_read_landmarks(float lmk[HEAD_LANDMARKS][2],
                          const struct record *rec, struct error *err)
{
    if (!record_find(rec, "lmk"))
        return 0;
    return motion_copy(&lmk[0][0], rec, "lmk", HEAD_LANDMARKS, 2, err) ? -1
                                                                       : 1;
}

void motion_arrays(struct array *a, const struct motion *m, size_t nexp)
{
    a[0] = array_make("rot", DTYPE_F32, m->R, 2, 3, 3, 0, 0);
    a[1] = array_make("trans", DTYPE_F32, m->t, 1, 3, 0, 0, 0);
    a[2] = array_make("exp", DTYPE_F32, m->exp, 1, nexp, 0, 0, 0);
    a[3] = array_make("jaw", DTYPE_F32, m->pose.jaw, 1, 3, 0, 0, 0);
    a[4] = array_make("lid", DTYPE_F32, m->pose.lid, 1, 2, 0, 0, 0);
    a[5] = array_make("eye", DTYPE_F32, m->pose.eye, 1, 6, 0, 0, 0);
    a[6] = array_make("crop", DTYPE_F32, m->crop, 1, 3, 0, 0, 0);
}

struct array motion_light(const struct motion *m)
{
    return array_make("light", DTYPE_F32, m->light, 1, 3, 0, 0, 0);
}

int motion_write(struct stream_writer *w, uint64_t frame, double time,
                 const struct motion *m, size_t nexp,
                 const struct array *others, int nothers, struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];
    int n = MOTION_ARRAYS;

    motion_arrays(a, m, nexp);
    if (m->lit)
        a[n++] = motion_light(m);
    for (int i = 0; i < nothers && n < STREAM_MAX_ARRAYS; i++)
        a[n++] = others[i];
    return stream_write(w, RECORD_MOTN, frame, time, a, n, err);
}

struct array motion_landmarks(const float *lmk)
{
    return array_make("lmk", DTYPE_F32, lmk, 2, HEAD_LANDMARKS, 2, 0, 0);
}

struct array motion_points(const float *points, size_t n)
{
    return array_make("points", DTYPE_F32, points, 2, n, 2, 0, 0);
}

struct array motion_confidence(const float *confidence)
{
    return array_make("sure", DTYPE_F32, confidence, 1, 1, 0, 0, 0);
}

struct array motion_calm(const float *face, size_t nexp)
{
    return array_make("calm", DTYPE_F32, face, 1, nexp + 5, 0, 0, 0);
}

int motion_read_calm(struct motion *m, const struct record *rec, size_t nexp,
                     struct error *err)
{
    float face[HEAD_MAX_EXP + 5];

    if (!record_find(rec, "calm"))
        return 0;
    if (motion_copy(face, rec, "calm", nexp + 5, 0, err))
        return -1;
    memcpy(m->exp, face, nexp * sizeof *face);
    memcpy(m->pose.jaw, face + nexp, sizeof m->pose.jaw);
    memcpy(m->pose.lid, face + nexp + 3, sizeof m->pose.lid);
    return 1;
}

void motion_face(float *face, const struct motion *m, size_t nexp)
{
    memcpy(face, m->exp, nexp * sizeof *face);
    memcpy(face + nexp, m->pose.jaw, sizeof m->pose.jaw);
    memcpy(face + nexp + 3, m->pose.lid, sizeof m->pose.lid);
}

struct array motion_lost(void)
{
    static const uint8_t one = 1;

    return array_make("lost", DTYPE_U8, &one, 1, 1, 0, 0, 0);
}

void motion_camera(float cam[12], const struct motion *m)
{
    camera_make(cam, m->R, m->t);
}
