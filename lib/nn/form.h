/* Which form of a convolution takes the fewest cycles on this processor, by
 * its sizes and what the processor multiplies in a cycle.  No clock is asked,
 * so that every run of a model on a processor gives the same bytes. */
#ifndef SPID_NN_FORM_H
#define SPID_NN_FORM_H

#include <stddef.h>

enum form {
    FORM_FLOAT,      /* direct */
    FORM_WINOGRAD,   /* F(4x4,3x3), in float */
    FORM_BF16,       /* direct, products of bfloat16 values */
    FORM_INT8        /* direct, products of 8-bit values */
};

/* Products a cycle; 0: there are no instructions for them. */
struct form_rates {
    double f32, bf16, int8;
    double abreast;              /* channels of the input that products of
                                  * bfloat16 take together, there or not */
};

struct form_layer {
    size_t in, out, kernel, stride;
};

/* Those of this processor, as far as SPID_CPU and ONEDNN_MAX_CPU_ISA let it. */
struct form_rates form_rates(void);
/* The form of the fewest cycles up to `max`: the types that a plan allows. */
enum form form_choose(const struct form_layer *l, enum form max,
                      const struct form_rates *r);
/* form_choose's answer from now on wherever that form is possible, for tests;
 * FORM_FLOAT: its own again. */
void form_prefer(enum form f);

#endif
