/* Four floats that C's operators work on at once, such as a colour and one number
 * more.  They may lie wherever a float does.  simd.h has vectors as wide as the
 * registers of each instruction set. */
#ifndef SPID_BASE_QUAD_H
#define SPID_BASE_QUAD_H

typedef float quad __attribute__((vector_size(16), aligned(4), may_alias));

#endif
