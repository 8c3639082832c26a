/* Which 3x3 convolutions run by Winograd: measured once by `make tune` and
 * kept in lib/nn/tune_table.inc. */
#ifndef SPID_NN_TUNE_H
#define SPID_NN_TUNE_H

#include <stdbool.h>
#include <stddef.h>

/* By the nearest measured layer of in -> out channels on h x w pixels: whether
 * Winograd (in float) is faster than the direct convolution, in float or in
 * bfloat16. */
bool tune_winograd(size_t in, size_t out, size_t h, size_t w, bool bf16);

#endif
