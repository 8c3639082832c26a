/* Reading and writing identity files. */
#include "lib/head/person.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"
#include "lib/stream/shape.h"
#include "lib/stream/conf_text.h"

/* out = the string under key, when there is one. */
static void person_read_hash(char out[17], const cJSON *conf, const char *key)
{
    const cJSON *v = cJSON_GetObjectItem(conf, key);

    if (cJSON_IsString(v))
        snprintf(out, 17, "%s", v->valuestring);
}

/* CONF says which head and model the identity was made with. */
static int person_read_conf(struct person *p, const struct record *rec)
{
    size_t bytes;
    const char *text = conf_text(&bytes, rec);

    if (!text)
        return 0;
    cJSON *conf = cJSON_ParseWithLength(text, bytes);
    person_read_hash(p->head, conf, "head_hash");
    person_read_hash(p->model, conf, "model_hash");
    cJSON_Delete(conf);
    return 1;
}

/* SHAP: a copy of beta. */
static int person_read_shape(struct person *p, const struct record *rec,
                             struct error *err)
{
    struct shape s;

    if (shape_read(&s, rec, err))
        return -1;
    float *copy = malloc((s.n ? s.n : 1) * sizeof *copy);
    if (!copy)
        return error_set(err, EX_OSERR, "no memory for an identity");
    memcpy(copy, s.beta, s.n * sizeof *copy);
    free(p->shape);
    p->shape = copy;
    p->nshape = s.n;
    return 1;
}

/* SRCI: a square picture, its matte and where it was cut from. */
static int person_read_picture(struct person *p, const struct record *rec,
                               struct error *err)
{
    size_t any[3] = {0, 0, 3}, three[1] = {3};
    const float *crop = NULL;
    const uint8_t *rgb = record_get(rec, "rgb", DTYPE_U8, 3, any, err);

    if (!rgb)
        return -1;
    size_t S = record_find(rec, "rgb")->dim[0];
    size_t square[3] = {S, S, 3};
    const uint8_t *matte = record_get(rec, "matte", DTYPE_U8, 2, square, err);
    const uint8_t *back = NULL, *confidence = NULL;
    if (!matte || !record_get(rec, "rgb", DTYPE_U8, 3, square, err) ||
        (record_find(rec, "crop") &&
         (record_check_finite(rec, err) ||
          !(crop = record_get(rec, "crop", DTYPE_F32, 1, three, err)))) ||
        (record_find(rec, "back") &&
         !(back = record_get(rec, "back", DTYPE_U8, 3, square, err))) ||
        (record_find(rec, "sure") &&
         !(confidence = record_get(rec, "sure", DTYPE_U8, 2, square, err))))
        return -1;
    if (crop)
        memcpy(p->crop, crop, sizeof p->crop);
    free(p->rgb);
    free(p->matte);
    free(p->back);
    free(p->confidence);
    p->size = S;
    p->rgb = malloc(3 * S * S + 1);
    p->matte = malloc(S * S + 1);
    p->back = back ? malloc(3 * S * S + 1) : NULL;
    p->confidence = confidence ? malloc(S * S + 1) : NULL;
    if (!p->rgb || !p->matte || (back && !p->back) ||
        (confidence && !p->confidence))
        return error_set(err, EX_OSERR, "no memory for the source picture");
    if (back)
        memcpy(p->back, back, 3 * S * S);
    if (confidence)
        memcpy(p->confidence, confidence, S * S);
    memcpy(p->rgb, rgb, 3 * S * S);
    memcpy(p->matte, matte, S * S);
    return 1;
}

bool person_is_further(const struct record *srci)
{
    return record_find(srci, "rot") != NULL;
}

/* SRCI of a further picture. */
static int person_read_further(struct person *p, const struct record *rec,
                               size_t nexp, struct error *err)
{
    if (p->nmore == PERSON_MORE)
        return error_set(err, EX_DATAERR, "identity has more than %d further "
                         "pictures", PERSON_MORE);
    struct person *more = realloc(p->more, (p->nmore + 1) * sizeof *more);
    if (!more)
        return error_set(err, EX_OSERR, "no memory for an identity");
    p->more = more;
    more += p->nmore++;
    memset(more, 0, sizeof *more);
    return person_read_picture(more, rec, err) < 0 ||
                   motion_read(&more->source, rec, nexp, err) ? -1 : 1;
}

int person_read_record(struct person *p, const struct record *rec, size_t nexp,
                       struct error *err)
{
    if (record_is(rec, RECORD_CONF))
        return person_read_conf(p, rec);
    if (record_is(rec, RECORD_SHAP))
        return person_read_shape(p, rec, err);
    if (record_is(rec, RECORD_SRCI))
        return person_is_further(rec) ? person_read_further(p, rec, nexp, err)
                                      : person_read_picture(p, rec, err);
    if (record_is(rec, RECORD_MOTN)) {
        if (motion_read(&p->source, rec, nexp, err))
            return -1;
        p->calm = p->source;
        if (nexp && motion_read_calm(&p->calm, rec, nexp, err) < 0)
            return -1;
        p->has_source = true;
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
        taken = person_read_record(p, &rec, nexp, err);
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

int person_load_picture(struct person *p, const char *path,
                        struct error *err)
{
    struct stream_reader *in = stream_open(path, NULL, err);
    struct record rec;
    int rc = -1;

    memset(p, 0, sizeof *p);
    while (in && !p->rgb && (rc = stream_read(in, &rec, err)) > 0)
        if (record_is(&rec, RECORD_SRCI) && !person_is_further(&rec))
            rc = person_read_picture(p, &rec, err);
    if (rc >= 0 && p->size == 0)
        rc = error_set(err, EX_DATAERR, "no SRCI record (expected an identity "
                       "from spid-shape)");
    stream_close(in);
    if (rc >= 0)
        return 0;
    person_release(p);
    return error_prefix(err, "%s", path);
}

int person_resize(struct person *q, const struct person *p, size_t size,
                  struct error *err)
{
    const size_t from = p->size;
    const double side = (double)from;
    const struct square all = {side / 2, side / 2, side};
    const uint8_t *in[4] = {p->rgb, p->back, p->matte, p->confidence};
    uint8_t **out[4] = {&q->rgb, &q->back, &q->matte, &q->confidence};
    bool done = true;

    memset(q, 0, sizeof *q);
    q->size = size;
    for (int k = 0; k < 4 && done; k++) {
        const int channels = k < 2 ? 3 : 1;

        if (!in[k])
            continue;
        *out[k] = malloc((size_t)channels * size * size);
        done = *out[k] &&
               crop_resize_u8(*out[k], size, in[k], from, from,
                              (size_t)channels * from, channels, all) == 0;
    }
    if (done)
        return 0;
    person_release(q);
    return error_set(err, EX_OSERR, "no memory for the source picture");
}

/* The arrays of a picture, PICTURE_ARRAYS at most; returns how many. */
#define PICTURE_ARRAYS 5
static size_t person_picture_arrays(struct array *a, const struct person *p)
{
    const size_t S = p->size;
    size_t n = 3;

    a[0] = array_make("rgb", DTYPE_U8, p->rgb, 3, S, S, 3, 0);
    a[1] = array_make("matte", DTYPE_U8, p->matte, 2, S, S, 0, 0);
    a[2] = array_make("crop", DTYPE_F32, p->crop, 1, 3, 0, 0, 0);
    if (p->back)
        a[n++] = array_make("back", DTYPE_U8, p->back, 3, S, S, 3, 0);
    if (p->confidence)
        a[n++] = array_make("sure", DTYPE_U8, p->confidence, 2, S, S, 0, 0);
    return n;
}

int person_write_picture(struct stream_writer *w, const struct person *p,
                         struct error *err)
{
    struct array a[PICTURE_ARRAYS];
    const size_t n = person_picture_arrays(a, p);

    return stream_write(w, RECORD_SRCI, 0, 0, a, n, err);
}

/* Further pictures, with their motion but for its face crop. */
static int person_write_further(struct stream_writer *w, const struct person *p,
                                size_t nexp, struct error *err)
{
    for (size_t k = 0; k < p->nmore; k++) {
        struct array a[PICTURE_ARRAYS + MOTION_ARRAYS];
        const size_t n = person_picture_arrays(a, p->more + k);

        motion_arrays(a + n, &p->more[k].source, nexp);
        if (stream_write(w, RECORD_SRCI, k + 1, 0, a, n + MOTION_ARRAYS - 1,
                         err))
            return -1;
    }
    return 0;
}

int person_write(struct stream_writer *w, const struct person *p, size_t nexp,
                 struct error *err)
{
    const struct shape shape = {.beta = p->shape, .n = p->nshape};
    float face[HEAD_MAX_EXP + 5];

    motion_face(face, &p->calm, nexp);
    const struct array calm = motion_calm(face, nexp);
    return person_write_picture(w, p, err) ||
                   shape_write(w, 0, 0, &shape, err) ||
                   motion_write(w, 0, 0, &p->source, nexp, &calm, 1, err) ||
                   person_write_further(w, p, nexp, err)
               ? -1
               : 0;
}

void person_release(struct person *p)
{
    for (size_t k = 0; k < p->nmore; k++)
        person_release(p->more + k);
    free(p->more);
    free(p->shape);
    free(p->rgb);
    free(p->matte);
    free(p->back);
    free(p->confidence);
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
