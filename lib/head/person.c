/* Reading and writing identity files. */
#include "lib/head/person.h"

#include <cjson/cJSON.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"
#include "lib/stream/records.h"
#include "lib/stream/schema.h"

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

int person_copy(float **out, const float *x, size_t n, struct error *err)
{
    free(*out);
    *out = x ? malloc((n ? n : 1) * sizeof *x) : NULL;
    if (x && !*out)
        return error_set(err, EX_OSERR, "no memory for an identity");
    if (x)
        memcpy(*out, x, n * sizeof *x);
    return 0;
}

/* SHAP: copies of beta and offset. */
static int person_read_shape(struct person *p, const struct record *rec,
                             struct error *err)
{
    struct shape s;

    if (shape_read(&s, rec, err))
        return -1;
    p->nshape = s.n;
    p->noffset = s.vertices;
    return person_copy(&p->shape, s.beta, s.n, err) ||
                   person_copy(&p->offset, s.offset, 3 * s.vertices, err)
               ? -1 : 1;
}

/* The arrays of a SRCI record: a square picture, its matte and where it was cut
 * from. */
struct picture {
    const uint8_t *rgb, *matte, *back, *confidence;
    const float *crop;
};
static const struct schema_field fields[] = {
    {"rgb", offsetof(struct picture, rgb), DTYPE_U8},
    {"matte", offsetof(struct picture, matte), DTYPE_U8},
    {"crop", offsetof(struct picture, crop), DTYPE_F32},
    {"back", offsetof(struct picture, back), DTYPE_U8},
    {"sure", offsetof(struct picture, confidence), DTYPE_U8}
};
enum { FIELDS = sizeof fields / sizeof *fields };

static int person_read_picture(struct person *p, const struct record *rec,
                               struct error *err)
{
    struct picture in = {0};

    if (schema_read(&in, rec, fields, FIELDS, err))
        return -1;
    const uint8_t *from[4] = {in.rgb, in.back, in.matte, in.confidence};
    uint8_t **to[4] = {&p->rgb, &p->back, &p->matte, &p->confidence};

    p->size = schema_rows(rec, "rgb");
    memcpy(p->crop, in.crop, sizeof p->crop);
    for (int k = 0; k < 4; k++) {
        const size_t n = (k < 2 ? 3 : 1) * p->size * p->size;

        free(*to[k]);
        *to[k] = from[k] ? malloc(n + 1) : NULL;
        if (from[k] && !*to[k])
            return error_set(err, EX_OSERR, "no memory for the source picture");
        if (from[k])
            memcpy(*to[k], from[k], n);
    }
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

struct person_loading {
    struct person *person;
    size_t nexp;
};

static int person_take(const struct record *rec, void *loading,
                       struct error *err)
{
    const struct person_loading *l = loading;

    return person_read_record(l->person, rec, l->nexp, err) < 0 ? -1 : 0;
}

int person_load(struct person *p, const char *path, size_t nexp,
                struct error *err)
{
    struct person_loading l = {p, nexp};

    memset(p, 0, sizeof *p);
    int rc = stream_load(path, person_take, &l, err);
    if (rc == 0 && !p->shape)
        rc = error_set(err, EX_DATAERR, "%s: no SHAP record (expected an "
                       "identity, as spid-shape writes it)", path);
    if (rc)
        person_release(p);
    return rc;
}

/* Up to the first picture. */
static int person_take_picture(const struct record *rec, void *person,
                               struct error *err)
{
    if (!record_is(rec, RECORD_SRCI) || person_is_further(rec))
        return 0;
    return person_read_picture(person, rec, err) < 0 ? -1 : 1;
}

int person_load_picture(struct person *p, const char *path,
                        struct error *err)
{
    memset(p, 0, sizeof *p);
    int rc = stream_load(path, person_take_picture, p, err);
    if (rc == 0)
        error_set(err, EX_DATAERR, "%s: no SRCI record (expected an identity "
                  "from spid-shape)", path);
    if (rc > 0)
        return 0;
    person_release(p);
    return -1;
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

/* The arrays of a picture into a (FIELDS); returns how many. */
static int person_picture_arrays(struct array *a, const struct person *p)
{
    const struct picture out = {p->rgb, p->matte, p->back, p->confidence,
                                p->crop};
    const size_t size[] = {['H'] = p->size};

    return schema_arrays(a, RECORD_SRCI, &out, fields, FIELDS, size);
}

int person_write_picture(struct stream_writer *w, const struct person *p,
                         struct error *err)
{
    struct array a[FIELDS];
    const int n = person_picture_arrays(a, p);

    return stream_write(w, RECORD_SRCI, 0, 0, a, n, err);
}

/* Further pictures, with their motion but for its face crop. */
static int person_write_further(struct stream_writer *w, const struct person *p,
                                size_t nexp, struct error *err)
{
    for (size_t k = 0; k < p->nmore; k++) {
        struct array a[FIELDS + MOTION_ARRAYS];
        const struct motion *m = &p->more[k].source;
        int n = person_picture_arrays(a, p->more + k);

        motion_arrays(a + n, m, nexp);
        n += MOTION_ARRAYS - 1;
        if (m->lit)
            a[n++] = motion_light(m);
        if (stream_write(w, RECORD_SRCI, k + 1, 0, a, n, err))
            return -1;
    }
    return 0;
}

int person_write(struct stream_writer *w, const struct person *p, size_t nexp,
                 struct error *err)
{
    const struct shape shape = {.beta = p->shape, .n = p->nshape,
                                .offset = p->offset, .vertices = p->noffset};
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
    free(p->offset);
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
    if (p->offset && p->noffset != h->V)
        return error_set(err, EX_DATAERR, "SHAP offset has %zu rows (expected "
                         "%zu, one for each of the head's vertices)",
                         p->noffset, h->V);
    if (head_fold(id, h, p->shape, p->nshape, err))
        return -1;
    if (p->offset)
        identity_move(id, p->offset);
    return 0;
}
