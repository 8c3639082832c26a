/* Graphs of ONNX operators: values, nodes, and our layers in them. */
#include "lib/nn/graph.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"

void graph_init(struct graph *g, const char *name, const char *about)
{
    *g = (struct graph){.file = {.name = name, .about = about}};
}

void graph_release(struct graph *g)
{
    for (size_t i = 0; i < g->file.values; i++)
        free(g->file.value[i].owned);
    free(g->file.value);
    free(g->file.node);
    free(g->file.output);
    memset(g, 0, sizeof *g);
}

void graph_fail(struct graph *g, int code, const char *text)
{
    if (!g->err.code)
        error_set(&g->err, code, "%s", text);
}

/* ---- values -------------------------------------------------------------- */

/* A new value; after a failure the first one, so that callers need not ask. */
static struct onnx_value *graph_add(struct graph *g, int *index)
{
    struct onnx_graph *f = &g->file;
    struct onnx_value *v = list_add(&f->value, &f->values, &f->value_room,
                                    sizeof *v, NULL);

    *index = v ? (int)f->values - 1 : 0;
    if (!v)
        graph_fail(g, EX_OSERR, "out of memory for a network's graph");
    return v;
}

static void graph_shape(struct onnx_value *v, int ndim, const size_t *dim)
{
    v->ndim = ndim;
    memcpy(v->dim, dim, (size_t)ndim * sizeof *dim);
}

int graph_input(struct graph *g, const char *name, int ndim,
                const size_t *dim)
{
    int index;
    struct onnx_value *v = graph_add(g, &index);

    if (!v)
        return 0;
    v->kind = ONNX_INPUT;
    snprintf(v->name, sizeof v->name, "%s", name);
    graph_shape(v, ndim, dim);
    return index;
}

void graph_output(struct graph *g, int v, const char *name, int ndim,
                  const size_t *dim)
{
    struct onnx_graph *f = &g->file;
    int *output = list_add(&f->output, &f->outputs, &f->output_room,
                           sizeof *output, NULL);

    if (!output || !f->values) {
        graph_fail(g, EX_OSERR, "out of memory for a network's graph");
        return;
    }
    *output = v;
    snprintf(f->value[v].name, sizeof f->value[v].name, "%s", name);
    graph_shape(&f->value[v], ndim, dim);
}

/* A tensor of ps, borrowed; once however often it is asked for. */
static int graph_weight(struct graph *g, const struct params *ps, size_t tensor)
{
    const struct param *p = &ps->tensor[tensor];
    int index;

    for (size_t i = 0; i < g->file.values; i++)
        if (!strcmp(g->file.value[i].name, p->name))
            return (int)i;
    struct onnx_value *v = graph_add(g, &index);
    if (!v)
        return 0;
    v->kind = ONNX_FLOATS;
    snprintf(v->name, sizeof v->name, "%s", p->name);
    graph_shape(v, p->ndim, p->dim);
    v->floats = param_w(ps, tensor);
    return index;
}

int graph_floats(struct graph *g, const float *x, size_t n)
{
    const size_t count = n ? n : 1;
    int index;
    struct onnx_value *v = graph_add(g, &index);

    if (!v)
        return 0;
    v->kind = ONNX_FLOATS;
    snprintf(v->name, sizeof v->name, "numbers.%d", index);
    graph_shape(v, n ? 1 : 0, &n);
    v->floats = v->owned = malloc(count * sizeof *x);
    if (v->owned)
        memcpy(v->owned, x, count * sizeof *x);
    else
        graph_fail(g, EX_OSERR, "out of memory for a network's graph");
    return index;
}

int graph_real(struct graph *g, float x)
{
    return graph_floats(g, &x, 0);
}

int graph_ints(struct graph *g, const int64_t *x, size_t n)
{
    int index;
    struct onnx_value *v = graph_add(g, &index);

    if (!v)
        return 0;
    v->kind = ONNX_INTS;
    snprintf(v->name, sizeof v->name, "list.%d", index);
    graph_shape(v, 1, &n);
    memcpy(v->ints, x, n * sizeof *x);
    return index;
}

/* ---- nodes --------------------------------------------------------------- */

int graph_node(struct graph *g, const char *op, const int *in, size_t n)
{
    struct onnx_graph *f = &g->file;
    int out;
    struct onnx_node *node = graph_add(g, &out)
                                 ? list_add(&f->node, &f->nodes, &f->node_room,
                                            sizeof *node, NULL) : NULL;

    if (!node) {
        graph_fail(g, EX_OSERR, "out of memory for a network's graph");
        return 0;
    }
    *node = (struct onnx_node){.op = op, .inputs = n, .outputs = 1};
    memcpy(node->input, in, n * sizeof *in);
    node->output[0] = out;
    return out;
}

/* A new attribute of the last node. */
static struct onnx_attribute *graph_attribute(struct graph *g,
                                              const char *name,
                                              enum onnx_attribute_kind kind)
{
    static struct onnx_attribute nowhere;       /* written, never read */

    if (!g->file.nodes)
        return &nowhere;
    struct onnx_node *node = &g->file.node[g->file.nodes - 1];
    struct onnx_attribute *a = &node->attribute[node->attributes++];
    *a = (struct onnx_attribute){.kind = kind, .name = name};
    return a;
}

void graph_set_int(struct graph *g, const char *name, int64_t x)
{
    graph_attribute(g, name, ONNX_INT)->list[0] = x;
}

void graph_set_ints(struct graph *g, const char *name, const int64_t *x,
                    size_t n)
{
    struct onnx_attribute *a = graph_attribute(g, name, ONNX_INT_LIST);

    a->count = n;
    memcpy(a->list, x, n * sizeof *x);
}

static void graph_set_real(struct graph *g, const char *name, float x)
{
    graph_attribute(g, name, ONNX_REAL)->real = x;
}

static void graph_set_text(struct graph *g, const char *name,
                           const char *text)
{
    graph_attribute(g, name, ONNX_TEXT)->text = text;
}

/* ---- arrangement --------------------------------------------------------- */

int graph_maps(struct graph *g, int x)
{
    const int64_t order[4] = {0, 3, 1, 2};

    x = GRAPH_NODE(g, "Transpose", x);
    graph_set_ints(g, "perm", order, 4);
    return x;
}

int graph_rows(struct graph *g, int x)
{
    const int64_t order[4] = {0, 2, 3, 1};

    x = GRAPH_NODE(g, "Transpose", x);
    graph_set_ints(g, "perm", order, 4);
    return x;
}

int graph_slice(struct graph *g, int x, size_t from, size_t to)
{
    return GRAPH_NODE(g, "Slice", x, GRAPH_INTS(g, (int64_t)from),
                      GRAPH_INTS(g, (int64_t)to), GRAPH_INTS(g, 1));
}

int graph_concat(struct graph *g, int a, int b)
{
    int x = GRAPH_NODE(g, "Concat", a, b);

    graph_set_int(g, "axis", 1);
    return x;
}

/* ---- layers -------------------------------------------------------------- */

int graph_act(struct graph *g, int x, enum nn_act act)
{
    static const char *const op[] = {
        [ACT_RELU] = "Relu", [ACT_LRELU] = "LeakyRelu",
        [ACT_HARDSWISH] = "HardSwish", [ACT_HARDSIGMOID] = "HardSigmoid",
        [ACT_SIGMOID] = "Sigmoid", [ACT_TANH] = "Tanh"
    };

    if (act == ACT_NONE)
        return x;
    if (act >= ACT_GELU) {
        graph_fail(g, EX_CONFIG, "the activation is no ONNX operator of this "
                   "opset");
        return x;
    }
    x = GRAPH_NODE(g, op[act], x);
    if (act == ACT_LRELU)
        graph_set_real(g, "alpha", ACT_SLOPE);
    if (act == ACT_HARDSIGMOID)
        graph_set_real(g, "alpha", 1.0f / 6);
    return x;
}

/* Stride and padding of the last node. */
static void graph_set_window(struct graph *g, size_t kernel, size_t stride,
                             enum conv_pad pad)
{
    const int64_t k = (int64_t)kernel, s = (int64_t)stride;
    const int64_t p = pad == CONV_NONE ? 0 : k / 2;

    graph_set_ints(g, "strides", (int64_t[]){s, s}, 2);
    if (pad == CONV_SAME)
        graph_set_text(g, "auto_pad", "SAME_UPPER");
    else
        graph_set_ints(g, "pads", (int64_t[]){p, p, p, p}, 4);
}

/* The convolution with these weights, without its act. */
static int graph_convolve(struct graph *g, int x, int weight,
                          const struct conv *c)
{
    if (c->shuffle || c->gamma != NN_NONE)
        graph_fail(g, EX_CONFIG, "this convolution has no ONNX form here");
    x = c->bias == NN_NONE
            ? GRAPH_NODE(g, "Conv", x, weight)
            : GRAPH_NODE(g, "Conv", x, weight,
                         graph_weight(g, c->ps, c->bias));
    graph_set_window(g, c->kernel, c->stride, c->pad);
    return x;
}

int graph_conv(struct graph *g, int x, const struct conv *c)
{
    return graph_act(g, graph_convolve(g, x, graph_weight(g, c->ps, c->weight),
                                       c), c->act);
}

int graph_conv_add(struct graph *g, int onto, int x, const struct conv *c)
{
    x = graph_convolve(g, x, graph_weight(g, c->ps, c->weight), c);
    return graph_act(g, GRAPH_NODE(g, "Add", onto, x), c->act);
}

int graph_dense(struct graph *g, int x, const struct dense *d)
{
    x = GRAPH_NODE(g, "Gemm", x, graph_weight(g, d->ps, d->weight),
                   graph_weight(g, d->ps, d->bias));
    graph_set_int(g, "transB", 1);
    return x;
}

int graph_linear(struct graph *g, int x, const struct conv *c)
{
    const struct dense d = { .ps = c->ps, .weight = c->weight,
                             .bias = c->bias };

    return graph_act(g, graph_dense(g, x, &d), c->act);
}

int graph_conditional_conv(struct graph *g, int x, int by,
                           const struct conditional_conv *v)
{
    const struct conv *c = v->conv;
    const int64_t k = (int64_t)c->kernel, n = (int64_t)v->n;
    const int64_t out = (int64_t)c->out, in = (int64_t)c->in;

    /* W + sum_j by[j] V_j */
    int row = GRAPH_NODE(g, "Reshape", by, GRAPH_INTS(g, 1, n));
    int vary = GRAPH_NODE(g, "Reshape", graph_weight(g, c->ps, v->tensor),
                          GRAPH_INTS(g, n, -1));
    int sum = GRAPH_NODE(g, "MatMul", row, vary);
    sum = GRAPH_NODE(g, "Reshape", sum, GRAPH_INTS(g, out, in, k, k));
    sum = GRAPH_NODE(g, "Add", sum, graph_weight(g, c->ps, c->weight));
    return graph_act(g, graph_convolve(g, x, sum, c), c->act);
}

int graph_depthwise(struct graph *g, int x, const struct depthwise *d)
{
    x = GRAPH_NODE(g, "Conv", x, graph_weight(g, d->ps, d->weight));
    graph_set_window(g, d->kernel, d->stride, d->pad);
    graph_set_int(g, "group", (int64_t)d->channels);
    return x;
}

int graph_batch_norm(struct graph *g, int x, const struct batch_norm *n)
{
    x = GRAPH_NODE(g, "BatchNormalization", x,
                   graph_weight(g, n->ps, n->weight),
                   graph_weight(g, n->ps, n->bias),
                   graph_weight(g, n->ps, n->mean),
                   graph_weight(g, n->ps, n->var));
    graph_set_real(g, "epsilon", n->eps);
    return graph_act(g, x, n->act);
}

int graph_squeeze_excite(struct graph *g, int x,
                         const struct squeeze_excite *s)
{
    int gate = GRAPH_NODE(g, "GlobalAveragePool", x);

    gate = graph_conv(g, graph_conv(g, gate, &s->reduce), &s->expand);
    gate = s->additive ? GRAPH_NODE(g, "Add", gate, graph_real(g, 1))
                       : graph_act(g, gate, ACT_HARDSIGMOID);
    return GRAPH_NODE(g, "Mul", x, gate);
}

int graph_mean(struct graph *g, int x)
{
    x = GRAPH_NODE(g, "Flatten", GRAPH_NODE(g, "GlobalAveragePool", x));
    graph_set_int(g, "axis", 1);
    return x;
}

int graph_resize(struct graph *g, int x, size_t C, size_t oh, size_t ow)
{
    x = GRAPH_NODE(g, "Resize", x, ONNX_LEFT_OUT, ONNX_LEFT_OUT,
                   GRAPH_INTS(g, 1, (int64_t)C, (int64_t)oh, (int64_t)ow));
    graph_set_text(g, "mode", "linear");
    graph_set_text(g, "coordinate_transformation_mode", "half_pixel");
    return x;
}

int graph_to_depth(struct graph *g, int x, size_t f)
{
    x = GRAPH_NODE(g, "SpaceToDepth", x);
    graph_set_int(g, "blocksize", (int64_t)f);
    return x;
}

int graph_to_space(struct graph *g, int x, size_t f)
{
    x = GRAPH_NODE(g, "DepthToSpace", x);
    graph_set_int(g, "blocksize", (int64_t)f);
    graph_set_text(g, "mode", "DCR");
    return x;
}
