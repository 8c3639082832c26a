/* Networks in the ONNX format (onnx.ai), through the library that carries its
 * schema: a graph of operators as plain data, and its file. */
#ifndef SPID_FORMATS_ONNX_H
#define SPID_FORMATS_ONNX_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

#define ONNX_OPSET 14           /* HardSwish is of 14 */
#define ONNX_DIMS 5
#define ONNX_ARGUMENTS 9        /* inputs of an operator */
#define ONNX_ATTRIBUTES 4
#define ONNX_LEFT_OUT (-1)      /* an optional input that is not given */

enum onnx_kind {
    ONNX_INNER,                 /* what an operator gives */
    ONNX_INPUT, ONNX_FLOATS, ONNX_INTS
};

/* What operators read and write, by its index in the graph. */
struct onnx_value {
    enum onnx_kind kind;
    char name[120];             /* of ONNX_INNER only what is an output's */
    int ndim;                   /* of ONNX_INNER only what is an output's */
    size_t dim[ONNX_DIMS];
    const float *floats;        /* ONNX_FLOATS: borrowed, or of the graph's */
    int64_t ints[ONNX_DIMS];    /* ONNX_INTS: one dimension of dim[0] */
    float *owned;               /* freed with the graph */
};

enum onnx_attribute_kind { ONNX_INT, ONNX_INT_LIST, ONNX_REAL, ONNX_TEXT };

struct onnx_attribute {
    enum onnx_attribute_kind kind;
    const char *name;
    int64_t list[ONNX_DIMS];    /* ONNX_INT: the first */
    size_t count;
    float real;
    const char *text;
};

struct onnx_node {
    const char *op;
    size_t inputs, outputs;
    int input[ONNX_ARGUMENTS], output[ONNX_ARGUMENTS];
    size_t attributes;
    struct onnx_attribute attribute[ONNX_ATTRIBUTES];
};

/* Nodes in an order in which they can run. */
struct onnx_graph {
    const char *name, *about;   /* about: a sentence for who opens the file */
    struct onnx_value *value;
    struct onnx_node *node;
    int *output;                /* values */
    size_t values, nodes, outputs;
    size_t value_room, node_room, output_room;
};

/* A file that takes its name when it is complete.  Numbers that are halves to the
 * bit are stored as halves and cast where they are used. */
int onnx_write(const char *path, const struct onnx_graph *g,
               struct error *err);

#endif
