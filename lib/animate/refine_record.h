/* What a FEAT record holds, as the refiner takes it. */
#ifndef SPID_ANIMATE_REFINE_RECORD_H
#define SPID_ANIMATE_REFINE_RECORD_H

#include "lib/base/error.h"
#include "lib/animate/refine.h"
#include "lib/stream/stream.h"

/* *in points into rec, which must stay.  Features that came without the pixels
 * that nothing covers are packed.  Errors as feat_read's. */
int refine_read_record(struct refine_input *in, const struct record *rec,
                       struct error *err);

#endif
