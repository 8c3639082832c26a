/* The arrays of a FEAT record, checked against each other: spid-stream(5). */
#include "lib/refine/refine_record.h"

#include <string.h>
#include <sysexits.h>

#include "lib/geom/relative_pose.h"
#include "lib/texture/texture.h"

/* Packed features are taken as the whole picture they stand for, which must
 * not be larger than a record may be. */
static int refine_record_check_size(const struct array *feat,
                                    const struct array *alpha,
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

/* The features themselves, (pixels,C) packed or (height,width,C), and the
 * coverage that says where packed ones lie. */
static int refine_record_feat(struct refine_input *in,
                              const struct record *rec, struct error *err)
{
    const struct array *a = record_find(rec, "feat");
    const struct array *alpha = record_find(rec, "alpha");
    const enum dtype type = a && a->dtype == DTYPE_F16 ? DTYPE_F16
                                                       : DTYPE_F32;
    const bool packed = a && a->ndim == 2 && alpha;
    const size_t any[3] = {0, 0, 0};
    const void *feat = record_get(rec, "feat", type, packed ? 2 : 3, any, err);

    if (!feat
        || (alpha && !(in->alpha = record_get(rec, "alpha", DTYPE_F32, 2,
                                              packed ? any : a->dim, err)))
        || record_check_finite(rec, err)
        || (packed && refine_record_check_size(a, alpha, err)))
        return -1;
    in->f16 = type == DTYPE_F16 ? feat : NULL;
    in->f32 = type == DTYPE_F32 ? feat : NULL;
    in->height = packed ? alpha->dim[0] : a->dim[0];
    in->width = packed ? alpha->dim[1] : a->dim[1];
    in->channels = a->dim[a->ndim - 1];
    in->packed = packed;
    in->pixels = packed ? a->dim[0] : 0;
    return 0;
}

/* What the photograph shows, looked up already: beside the features, packed
 * as they are. */
static int refine_record_photo(struct refine_input *in,
                               const struct record *rec, struct error *err)
{
    const size_t whole[3] = {in->height, in->width, TEXTURE_PHOTO};
    const size_t packed[2] = {in->pixels, TEXTURE_PHOTO};

    if (!record_find(rec, "photo"))
        return 0;
    if (!in->alpha)
        return error_set(err, EX_DATAERR, "FEAT has photo without alpha");
    in->photo = record_get(rec, "photo", DTYPE_F32, in->packed ? 2 : 3,
                           in->packed ? packed : whole, err);
    return in->photo ? 0 : -1;
}

/* Where it is to be looked up. */
static int refine_record_place(struct refine_input *in,
                               const struct record *rec, struct error *err)
{
    const size_t numbers[1] = {6};
    const size_t dims[3] = {in->height, in->width, PLACE_CHANNELS};
    const float *map;

    if (!record_find(rec, "place"))
        return 0;
    map = record_get(rec, "map", DTYPE_F32, 1, numbers, err);
    if (map && !in->alpha)
        return error_set(err, EX_DATAERR, "FEAT has place without alpha");
    if (!map ||
        !(in->place = record_get(rec, "place", DTYPE_F32, 3, dims, err)))
        return -1;
    memcpy(in->view.A, map, sizeof in->view.A);
    memcpy(in->view.b, map + 4, sizeof in->view.b);
    return 0;
}

int refine_read_record(struct refine_input *in, const struct record *rec,
                       struct error *err)
{
    const size_t turns[1] = {RELATIVE_POSE_SIZE};

    memset(in, 0, sizeof *in);
    if (refine_record_feat(in, rec, err))
        return -1;
    if (record_find(rec, "turn")
        && !(in->turn = record_get(rec, "turn", DTYPE_F32, 1, turns, err)))
        return -1;
    return refine_record_photo(in, rec, err) ||
           refine_record_place(in, rec, err) ? -1 : 0;
}
