/* A FEAT record's arrays as the refiner takes them. */
#include "lib/animate/refine_record.h"

#include <string.h>
#include <sysexits.h>

#include "lib/base/relative_pose.h"
#include "lib/stream/feat.h"
#include "lib/photo/place.h"
#include "lib/photo/texture.h"

_Static_assert(FEAT_PHOTO == TEXTURE_PHOTO &&
               FEAT_PLACE == SPLAT_PLACE_CHANNELS &&
               FEAT_TURN == RELATIVE_POSE_SIZE,
               "FEAT holds what the texture and the refiner take");

int refine_read_record(struct refine_input *in, const struct record *rec,
                       struct error *err)
{
    struct feat f;

    if (feat_read(&f, rec, err))
        return -1;
    if (f.gain && f.height != f.width)
        return error_set(err, EX_DATAERR, "FEAT of %zu x %zu pixels has gain "
                         "(expected a square)", f.height, f.width);
    *in = (struct refine_input){
        .height = f.height, .width = f.width, .channels = f.channels,
        .f32 = f.f32, .f16 = f.f16, .alpha = f.alpha, .turn = f.turn,
        .packed = f.packed, .pixels = f.pixels, .photo = f.photo,
        .place = f.place, .gain = f.gain, .tint = f.tint
    };
    if (f.place)
        memcpy(&in->view, f.map, FEAT_MAP * sizeof *f.map);
    return 0;
}
