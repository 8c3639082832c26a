/* What an array holds, in four numbers. */
#ifndef SPID_STREAM_STATS_H
#define SPID_STREAM_STATS_H

#include "lib/stream/stream.h"

struct array_stats {
    double min, mean, max;     /* of the finite values; NaN when none */
    size_t nonfinite;          /* NaN or infinite */
};

/* Of all numbers of a. */
void array_stats(struct array_stats *s, const struct array *a);

/* Element i as a double (exact for every dtype). */
double array_value(const struct array *a, size_t i);

#endif
