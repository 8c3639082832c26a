/* Parts of the splat stage. */
#ifndef SPID_BENCH_BENCH_SPLAT_H
#define SPID_BENCH_BENCH_SPLAT_H

#include "lib/bench/bench.h"

/* Forward and backward together, with gradients held against the double
 * reference; seconds for each row. */
int bench_splat_backward(struct bench *b, double seconds, struct error *err);
/* Time over the number of Gaussians and of pixels, with linear fits. */
int bench_splat_scaling(struct bench *b, double seconds, struct error *err);
/* What a frame costs that moves all, some or no Gaussians; where the time
 * goes, on one thread and on all; memory. */
int bench_splat_moving(struct bench *b, double seconds, struct error *err);
/* Hard scenes: time as a ratio to an ordinary one, error. */
int bench_splat_hard(struct bench *b, double seconds, struct error *err);

#endif
