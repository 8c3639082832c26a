/* Parts of the splat stage. */
#ifndef SPID_LAB_BENCH_BENCH_SPLAT_H
#define SPID_LAB_BENCH_BENCH_SPLAT_H

#include "lib/lab/bench/bench.h"

/* Forward and backward together, with gradients held against the double
 * reference; seconds for each row. */
int bench_splat_backward(struct bench *b, double seconds, struct error *err);
/* What a frame costs that moves all, some or no Gaussians; where the time
 * goes, on one thread and on all; memory. */
int bench_splat_moving(struct bench *b, double seconds, struct error *err);
#endif
