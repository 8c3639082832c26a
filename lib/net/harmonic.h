/* gamma(n): the harmonic encoding of a direction, 27 numbers. */
#ifndef SPID_NET_HARMONIC_H
#define SPID_NET_HARMONIC_H

#include <stddef.h>

#include "lib/nn/graph.h"

#define HARMONIC_OUT 27

/* enc (B,27) of dir (B,3): for d in x,y,z and k in 0..3 sin(2^k v_d) at 4d+k,
 * cos(2^k v_d) at 12+4d+k, then v itself at 24..26. */
void harmonic_forward(float *enc, const float *dir, size_t B);
/* ddir (B,3) is added to. */
void harmonic_backward(float *ddir, const float *denc, const float *dir,
                       size_t B);

/* gamma (1,27) of dir (1,3). */
int harmonic_graph(struct graph *g, int dir);

#endif
