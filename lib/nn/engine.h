/* oneDNN, once: the engine and stream of the process, and a primitive with
 * its arguments.  Private to lib/nn. */
#ifndef SPID_NN_ENGINE_H
#define SPID_NN_ENGINE_H

#include <oneapi/dnnl/dnnl.h>

#include "lib/nn/plan.h"

#define NN_ARGS 6

struct nn_call {
    dnnl_primitive_t prim;
    dnnl_exec_arg_t arg[NN_ARGS];
    void *data[NN_ARGS];         /* what each argument points to now */
    int count;
};

/* NULL when oneDNN cannot make one. */
dnnl_engine_t nn_engine(void);
/* Whether oneDNN may use these instructions here. */
bool nn_has(dnnl_cpu_isa_t isa);

/* Make the primitive of pd; pd stays the caller's.  Failures go to p. */
void nn_call_init(struct nn_call *c, const_dnnl_primitive_desc_t pd,
                  struct nn_plan *p);
/* Free what _init and _plan allocated; zeroed then. */
void nn_call_release(struct nn_call *c);
/* Declare argument `id` (DNNL_ARG_SRC, ...); returns its index. */
int nn_call_arg(struct nn_call *c, int id, const dnnl_memory_desc_t *md,
                struct nn_plan *p);
/* Declare the scratchpad pd asks for; returns its size. */
size_t nn_call_scratch(struct nn_call *c, const_dnnl_primitive_desc_t pd,
                       struct nn_plan *p);
/* Point argument index i at data. */
void nn_call_set(struct nn_call *c, int i, const void *data);
/* Run it on the stream, with the arguments as set, on this thread alone. */
void nn_call_run(struct nn_call *c);

#endif
