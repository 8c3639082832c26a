/* Reading and writing FEAT, whose arrays are checked against each other:
 * spid-stream(5). */
#include "lib/stream/feat.h"

#include <string.h>
#include <sysexits.h>

/* Packed features are taken as the whole picture they stand for, which must
 * not be larger than a record may be. */
static int feat_check_size(const struct array *feat, const struct array *alpha,
                           struct error *err)
{
    const size_t n = array_count(alpha);
    const size_t bytes = feat->dim[1] * dtype_size(feat->dtype);

    if (n > SIZE_MAX / (bytes + 1) || n * bytes > stream_limit())
        return error_set(err, EX_DATAERR, "FEAT feat of %zu x %zu pixels is "
                         "larger than --max-bytes", alpha->dim[1],
                         alpha->dim[0]);
    return 0;
}

/* The features themselves, and the coverage that says where packed ones lie. */
static int feat_read_features(struct feat *f, const struct record *rec,
                              struct error *err)
{
    const struct array *a = record_find(rec, "feat");
    const struct array *alpha = record_find(rec, "alpha");
    const enum dtype type = a && a->dtype == DTYPE_F16 ? DTYPE_F16
                                                       : DTYPE_F32;
    const bool packed = a && a->ndim == 2 && alpha;
    const size_t any[3] = {0, 0, 0};
    const void *feat = record_get(rec, "feat", type, packed ? 2 : 3, any, err);

    if (!feat
        || (alpha && !(f->alpha = record_get(rec, "alpha", DTYPE_F32, 2,
                                             packed ? any : a->dim, err)))
        || record_check_finite(rec, err)
        || (packed && feat_check_size(a, alpha, err)))
        return -1;
    f->f16 = type == DTYPE_F16 ? feat : NULL;
    f->f32 = type == DTYPE_F32 ? feat : NULL;
    f->height = packed ? alpha->dim[0] : a->dim[0];
    f->width = packed ? alpha->dim[1] : a->dim[1];
    f->channels = a->dim[a->ndim - 1];
    f->packed = packed;
    f->pixels = packed ? a->dim[0] : 0;
    return 0;
}

/* What the photograph shows, looked up already: beside the features, packed
 * as they are. */
static int feat_read_photo(struct feat *f, const struct record *rec,
                           struct error *err)
{
    const size_t whole[3] = {f->height, f->width, FEAT_PHOTO};
    const size_t packed[2] = {f->pixels, FEAT_PHOTO};

    if (!record_find(rec, "photo"))
        return 0;
    if (!f->alpha)
        return error_set(err, EX_DATAERR, "FEAT has photo without alpha");
    f->photo = record_get(rec, "photo", DTYPE_F32, f->packed ? 2 : 3,
                          f->packed ? packed : whole, err);
    return f->photo ? 0 : -1;
}

/* Where it is to be looked up. */
static int feat_read_place(struct feat *f, const struct record *rec,
                           struct error *err)
{
    const size_t numbers[1] = {FEAT_MAP};
    const size_t dims[3] = {f->height, f->width, FEAT_PLACE};

    if (!record_find(rec, "place"))
        return 0;
    f->map = record_get(rec, "map", DTYPE_F32, 1, numbers, err);
    if (f->map && !f->alpha)
        return error_set(err, EX_DATAERR, "FEAT has place without alpha");
    if (f->map)
        f->place = record_get(rec, "place", DTYPE_F32, 3, dims, err);
    return f->place ? 0 : -1;
}

int feat_read(struct feat *f, const struct record *rec, struct error *err)
{
    const size_t turn[1] = {FEAT_TURN};

    memset(f, 0, sizeof *f);
    if (feat_read_features(f, rec, err))
        return -1;
    if (record_find(rec, "turn")
        && !(f->turn = record_get(rec, "turn", DTYPE_F32, 1, turn, err)))
        return -1;
    return feat_read_photo(f, rec, err) || feat_read_place(f, rec, err) ? -1
                                                                        : 0;
}

int feat_write(struct stream_writer *w, uint64_t frame, double time,
               const struct feat *f, const struct iovec *part, size_t parts,
               struct error *err)
{
    const enum dtype type = f->f32 ? DTYPE_F32 : DTYPE_F16;
    const void *feat = f->f32 ? (const void *)f->f32 : f->f16;
    const size_t h = f->height, width = f->width, C = f->channels;
    const size_t n = f->pixels;
    const bool packed = f->packed;
    const struct array all[] = {
        packed ? array_make("feat", type, feat, 2, n, C, 0, 0)
               : array_make("feat", type, feat, 3, h, width, C, 0),
        array_make("alpha", DTYPE_F32, f->alpha, 2, h, width, 0, 0),
        array_make("depth", DTYPE_F32, f->depth, 2, h, width, 0, 0),
        packed ? array_make("photo", DTYPE_F32, f->photo, 2, n, FEAT_PHOTO, 0,
                            0)
               : array_make("photo", DTYPE_F32, f->photo, 3, h, width,
                            FEAT_PHOTO, 0),
        array_make("place", DTYPE_F32, f->place, 3, h, width, FEAT_PLACE, 0),
        array_make("map", DTYPE_F32, f->place ? f->map : NULL, 1, FEAT_MAP, 0,
                   0, 0),
        array_make("turn", DTYPE_F32, f->turn, 1, FEAT_TURN, 0, 0, 0)
    };
    struct array a[sizeof all / sizeof *all];

    return stream_write_parts(w, RECORD_FEAT, frame, time, a,
                              array_present(a, all, sizeof all / sizeof *all),
                              part, parts, err);
}
