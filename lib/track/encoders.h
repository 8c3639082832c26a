/* E_m and E_beta of a model file and the matte network: E_beta ready to run on
 * one face crop, the other on one portrait. */
#ifndef SPID_TRACK_ENCODERS_H
#define SPID_TRACK_ENCODERS_H

#include <stdbool.h>

#include "lib/base/error.h"
#include "lib/net/light_net.h"
#include "lib/net/model.h"
#include "lib/net/matte_net.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/shape_encoder.h"
#include "lib/nn/params.h"

struct encoders {
    struct params ps;
    struct motion_encoder motion;
    struct shape_encoder shape;         /* when with_shape */
    struct matte_net matte;             /* when has_matte */
    struct light_net light;             /* of a model without, 0 */
    bool has_matte;
};

/* Load the motion encoder, of this type, but without a plan: motion_tta_init
 * makes one for the crops that it will see at a time.  When with_shape load the
 * shape encoder and the matte network, which a model may lack.  The model may
 * be closed afterwards.  Errors name file, tensor, expected and found shape;
 * nothing is left allocated then. */
int encoders_open(struct encoders *e, const struct model *m, bool with_shape,
                  enum nn_type type, struct error *err);
/* Free what it holds; zeroed then. */
void encoders_release(struct encoders *e);

#endif
