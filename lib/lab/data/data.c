/* Reading people from streams.  A person is complete when the next one's
 * SHAP, or the end of the file, is read. */
#include "lib/lab/data/data.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/names.h"
#include "lib/base/list.h"
#include "lib/stream/records.h"
#include "lib/stream/stream.h"

struct data_reader {
    const char *const *names;  /* as given: files, folders, "-" */
    size_t nnames;
    struct names files;        /* what they stand for in this pass */
    size_t at;                 /* file being read */
    double margin;
    struct stream_reader *in;
    bool once;                 /* one pass only */
    uint64_t people;           /* SHAP records seen in this pass */
    uint64_t ever;             /* frames read, over all passes */
    size_t size;               /* side of the pictures, once known */
    bool have_shape, have_motion;
    int id;
    float shape[DATA_SHAPE];
    data_shape_fn *shape_fn;
    void *shape_ctx;
    struct data_frame next;    /* truth read, picture to come */
};

/* The picture; the rest is no memory of its own. */
static void data_frame_release(struct data_frame *f)
{
    free(f->rgba);
    free(f->alone);
    free(f->hidden);
    f->rgba = f->alone = f->hidden = NULL;
}

void data_person_release(struct data_person *p)
{
    for (size_t i = 0; i < p->count; i++)
        data_frame_release(&p->frame[i]);
    free(p->frame);
    memset(p, 0, sizeof *p);
}

static bool data_is_stream(const char *entry)
{
    return entry[0] != '.' && file_ends(entry, ".spid");
}

/* The files that the names stand for now: a folder may grow from one pass to
 * the next. */
static int data_list_files(struct data_reader *r, struct error *err)
{
    names_release(&r->files);
    r->at = 0;
    for (size_t i = 0; i < r->nnames; i++) {
        const char *name = r->names[i];
        struct stat st;
        const bool folder = !stat(name, &st) && S_ISDIR(st.st_mode);
        int rc = folder ? names_add_folder(&r->files, name, data_is_stream, err)
                        : names_add(&r->files, name, err);

        if (folder && rc == 0)
            rc = error_set(err, EX_NOINPUT, "%s: no streams (expected *.spid)",
                           name);
        if (rc < 0)
            return -1;
    }
    return 0;
}

struct data_reader *data_open(const char *const *names, size_t count,
                              double margin, struct error *err)
{
    struct data_reader *r;

    if (count == 0)
        return error_null(err, EX_USAGE, "no training data (expected streams "
                          "of spid-synth, or - for standard input)");
    r = calloc(1, sizeof *r);
    if (!r)
        return error_null(err, EX_OSERR, "out of memory");
    r->names = names;
    r->nnames = count;
    r->margin = margin;
    if (data_list_files(r, err)) {
        data_close(r);
        return NULL;
    }
    return r;
}

void data_close(struct data_reader *r)
{
    if (!r)
        return;
    stream_close(r->in);
    names_release(&r->files);
    free(r);
}

/* ---- records ----------------------------------------------------------- */

/* SHAP: who comes next. */
static int data_take_shape(struct data_reader *r, const struct record *rec,
                           struct error *err)
{
    struct shape s;

    if (shape_read(&s, rec, err))
        return -1;
    if (s.n != DATA_SHAPE)
        return error_set(err, EX_DATAERR, "SHAP shape is f32[%zu] (expected "
                         "f32[%d])", s.n, DATA_SHAPE);
    memcpy(r->shape, s.beta, sizeof r->shape);
    r->id = (int)r->people++;
    if (s.person)
        r->id = *s.person;
    r->have_shape = true;
    r->have_motion = false;
    return 0;
}

/* MOTN: the truth of the picture that comes next. */
static int data_take_motion(struct data_reader *r, const struct record *rec,
                            struct error *err)
{
    int found;

    if (motion_read(&r->next.motion, rec, DATA_EXP, err) ||
        (found = motion_read_landmarks(r->next.lmk, rec, err)) < 0)
        return -1;
    if (!found)
        return error_set(err, EX_DATAERR, "MOTN has no array 'lmk' (expected "
                         "f32[68,2])");
    r->next.crop = crop_from_landmarks(&r->next.lmk[0][0], 68);
    r->have_motion = true;
    return 0;
}

/* To a whole pixel inside the picture. */
static size_t data_clamp_edge(double x, size_t size)
{
    return x < 0 ? 0 : x > (double)size ? size : (size_t)x;
}

/* The part of the picture to keep. */
static void data_choose_part(struct data_frame *f, size_t size, double margin)
{
    double half = 0.5 * margin * f->crop.size;

    f->size = size;
    f->x0 = f->y0 = 0;
    f->width = f->height = size;
    if (margin <= 0)
        return;
    f->x0 = data_clamp_edge(floor(f->crop.x - half), size);
    f->y0 = data_clamp_edge(floor(f->crop.y - half), size);
    f->width = data_clamp_edge(ceil(f->crop.x + half), size) - f->x0;
    f->height = data_clamp_edge(ceil(f->crop.y + half), size) - f->y0;
}

#define LABEL_FRONT 15      /* spid-synth(1): something before the person */

/* Of whole pictures: the person alone, and what hides them, if it is there. */
static int data_take_extras(struct data_frame *f, const struct imag *im,
                            struct error *err)
{
    const size_t n = im->height * im->width;
    const bool hides = im->label && memchr(im->label, LABEL_FRONT, n);

    f->alone = im->alone ? malloc(3 * n) : NULL;
    f->hidden = hides ? malloc(n) : NULL;
    if ((im->alone && !f->alone) || (hides && !f->hidden))
        return error_set(err, EX_OSERR, "out of memory (picture of %zux%zu)",
                         im->height, im->width);
    if (im->alone)
        memcpy(f->alone, im->alone, 3 * n);
    for (size_t i = 0; hides && i < n; i++)
        f->hidden[i] = im->label[i] == LABEL_FRONT;
    return 0;
}

/* IMAG: the part of the picture that is kept, with its mask. */
static int data_take_picture(struct data_reader *r, const struct record *rec,
                             struct error *err)
{
    struct data_frame *f = &r->next;
    struct imag im;
    uint8_t *to;

    if (imag_read(&im, rec, err))
        return -1;
    const size_t size = im.width;
    /* crops are sampled at one size from whatever there is */
    if (r->margin == 0 && r->size && size != r->size)
        return error_set(err, EX_DATAERR, "picture of %zux%zu among pictures "
                         "of %zux%zu (expected one size)", size, size,
                         r->size, r->size);
    r->size = size;
    data_choose_part(f, size, r->margin);
    if (!f->width || !f->height)
        return error_set(err, EX_DATAERR, "the face lies outside the "
                         "picture");
    to = f->rgba = malloc(4 * f->width * f->height);
    if (!f->rgba)
        return error_set(err, EX_OSERR, "out of memory (picture of %zux%zu)",
                         size, size);
    for (size_t y = f->y0; y < f->y0 + f->height; y++)
        for (size_t x = f->x0; x < f->x0 + f->width; x++, to += 4) {
            memcpy(to, im.rgb + 3 * (y * size + x), 3);
            to[3] = im.mask[y * size + x];
        }
    return r->margin > 0 ? 0 : data_take_extras(f, &im, err);
}

/* Append a frame, whose picture moves. */
static int data_keep_frame(struct data_person *p, struct data_frame *f,
                           struct error *err)
{
    struct data_frame *to = list_add(&p->frame, &p->count, &p->room, sizeof *to,
                                     err);

    if (!to)
        return -1;
    *to = *f;
    f->rgba = f->alone = f->hidden = NULL;
    return 0;
}

/* ---- people ------------------------------------------------------------ */

/* The next file, the first one after the last: 0, 1 when one pass was all,
 * -1. */
static int data_open_file(struct data_reader *r, struct error *err)
{
    struct stream_options opt = {.trust = true};

    if (r->at == r->files.count) {
        if (!r->ever)
            return error_set(err, EX_DATAERR, "%s: no person with frames "
                             "(expected SHAP, MOTN and IMAG records)",
                             r->names[0]);
        if (r->once)
            return 1;
        r->people = 0;
        if (r->nnames == 1 && !strcmp(r->names[0], "-"))
            return error_set(err, EX_NOINPUT, "<stdin>: the data ended "
                             "(expected people for every step)");
        if (data_list_files(r, err))
            return -1;
    }
    r->have_shape = r->have_motion = false;
    r->in = stream_open(r->files.name[r->at], &opt, err);
    return r->in ? 0 : -1;
}

/* File, frame and record before a message. */
static int data_locate(struct data_reader *r, const struct record *rec,
                       struct error *err)
{
    return error_prefix(err, "%s: frame %llu: %s", stream_name(r->in),
                        (unsigned long long)rec->frame, rec->type);
}

/* Handle one record of a person; without pictures they are only counted. */
static int data_take_record(struct data_reader *r, const struct record *rec,
                            struct data_person *p, bool pictures,
                            struct error *err)
{
    if (record_is(rec, RECORD_MOTN)) {
        if (!pictures)
            return 0;
        return data_take_motion(r, rec, err) ? data_locate(r, rec, err) : 0;
    }
    if (!record_is(rec, RECORD_IMAG))
        return 0;
    r->ever++;
    if (!pictures) {
        p->count++;            /* counted only: see data_skip */
        return 0;
    }
    if (!r->have_motion) {
        error_set(err, EX_DATAERR, "picture without its true motion "
                  "(expected a MOTN record before it)");
        return data_locate(r, rec, err);
    }
    r->have_motion = false;
    if (data_take_picture(r, rec, err) || data_keep_frame(p, &r->next, err)) {
        data_frame_release(&r->next);
        return data_locate(r, rec, err);
    }
    return 0;
}

/* Read to the end of the next person that has frames; 1: there is none. */
static int data_read_person(struct data_reader *r, struct data_person *p,
                            bool pictures, struct error *err)
{
    struct record rec;
    bool mine = false; /* p's shape has been set */
    int rc;

    for (;;) {
        if (!r->in && (rc = data_open_file(r, err)))
            return rc;
        if (r->have_shape && !mine) {
            memcpy(p->shape, r->shape, sizeof p->shape);
            p->id = r->id;
            mine = true;
        }
        rc = stream_read(r->in, &rec, err);
        if (rc < 0)
            return -1;
        if (rc == 0) {
            stream_close(r->in);
            r->in = NULL;
            r->at++;
            if (p->count)
                return 0;
            mine = false;
        } else if (record_is(&rec, RECORD_SHAP)) {
            if (data_take_shape(r, &rec, err))
                return data_locate(r, &rec, err);
            if (p->count)
                return 0;      /* the new shape waits in r */
            mine = false;
        } else if (r->have_shape) {
            if (data_take_record(r, &rec, p, pictures, err))
                return -1;
        } else if (record_is(&rec, RECORD_IMAG)) {
            error_set(err, EX_DATAERR, "picture of nobody (expected a SHAP "
                      "record before it)");
            return data_locate(r, &rec, err);
        }
    }
}

void data_reshape(struct data_reader *r, data_shape_fn *fn, void *ctx)
{
    r->shape_fn = fn;
    r->shape_ctx = ctx;
}

int data_next(struct data_reader *r, struct data_person *p,
              struct error *err)
{
    int rc;

    memset(p, 0, sizeof *p);
    rc = data_read_person(r, p, true, err);
    if (!rc && r->shape_fn)
        rc = r->shape_fn(r->shape_ctx, p, err) ? -1 : 0;
    if (rc)
        data_person_release(p);
    return rc;
}

void data_once(struct data_reader *r)
{
    r->once = true;
}

/* Pass over n people; their pictures are not looked at. */
static int data_skip(struct data_reader *r, uint64_t n, struct error *err)
{
    for (uint64_t i = 0; i < n; i++) {
        struct data_person p = {0};
        if (data_read_person(r, &p, false, err))
            return -1;
    }
    return 0;
}

/* ---- the pool ---------------------------------------------------------- */

int data_pool_init(struct data_pool *pool, struct data_reader *reader,
                   size_t size, uint64_t read, struct error *err)
{
    pool->reader = reader;
    pool->size = size;
    pool->read = read > size ? read - size : 0;
    pool->person = calloc(size, sizeof *pool->person);
    if (!pool->person)
        return error_set(err, EX_OSERR, "out of memory (%zu people)", size);
    if (data_skip(reader, pool->read, err) ||
        data_pool_advance(pool, read > size ? read : size, err)) {
        data_pool_release(pool);
        return -1;
    }
    return 0;
}

void data_pool_release(struct data_pool *pool)
{
    for (size_t i = 0; pool->person && i < pool->size; i++)
        data_person_release(&pool->person[i]);
    free(pool->person);
    pool->person = NULL;
}

int data_pool_advance(struct data_pool *pool, uint64_t read,
                      struct error *err)
{
    while (pool->read < read) {
        struct data_person *slot = &pool->person[pool->read % pool->size];
        data_person_release(slot);
        if (data_next(pool->reader, slot, err))
            return -1;
        pool->read++;
    }
    return 0;
}

const struct data_frame *data_pool_draw(const struct data_pool *pool,
                                        const struct data_person **who,
                                        struct random *r)
{
    const struct data_person *p =
        &pool->person[random_below(r, (uint32_t)pool->size)];

    *who = p;
    return &p->frame[random_below(r, (uint32_t)p->count)];
}
