/* The ONNX format by its own protocol buffers. */
extern "C" {
#include "formats/onnx.h"
}

#include <cstring>
#include <string>
#include <sysexits.h>

#define ONNX_ML 1
#define ONNX_NAMESPACE onnx
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wshadow"
#include <onnx/onnx_pb.h>
#pragma GCC diagnostic pop

extern "C" {
#include "formats/outfile.h"
#include "lib/base/half.h"
}

namespace {

constexpr size_t FEW = 64;      /* numbers that are not worth a cast */

std::string value_name(const onnx_graph *g, int v)
{
    if (v == ONNX_LEFT_OUT)
        return "";
    const onnx_value &value = g->value[v];

    return value.name[0] ? value.name : "v" + std::to_string(v);
}

size_t value_count(const onnx_value &v)
{
    size_t n = 1;

    for (int i = 0; i < v.ndim; i++)
        n *= v.dim[i];
    return n;
}

bool all_halves(const float *x, size_t n)
{
    if (n < FEW)
        return false;
    for (size_t i = 0; i < n; i++) {
        const float back = half_to_float(float_to_half(x[i]));

        if (memcmp(&back, x + i, sizeof back))
            return false;
    }
    return true;
}

/* An initialiser of the graph; halves come with a node that casts them. */
void add_floats(onnx::GraphProto *to, const onnx_value &v)
{
    const size_t n = value_count(v);
    const bool half = all_halves(v.floats, n);
    onnx::TensorProto *t = to->add_initializer();
    std::string raw;

    for (int i = 0; i < v.ndim; i++)
        t->add_dims((int64_t)v.dim[i]);
    t->set_name(half ? std::string(v.name) + ".half" : v.name);
    if (!half) {
        t->set_data_type(onnx::TensorProto::FLOAT);
        raw.assign((const char *)v.floats, n * sizeof *v.floats);
        t->set_raw_data(raw);
        return;
    }
    t->set_data_type(onnx::TensorProto::FLOAT16);
    for (size_t i = 0; i < n; i++) {
        const uint16_t h = float_to_half(v.floats[i]);

        raw.append((const char *)&h, sizeof h);
    }
    t->set_raw_data(raw);
    onnx::NodeProto *cast = to->add_node();
    cast->set_op_type("Cast");
    cast->set_name(std::string(v.name) + ".cast");
    cast->add_input(t->name());
    cast->add_output(v.name);
    onnx::AttributeProto *type = cast->add_attribute();
    type->set_name("to");
    type->set_type(onnx::AttributeProto::INT);
    type->set_i(onnx::TensorProto::FLOAT);
}

void add_ints(onnx::GraphProto *to, const onnx_graph *g, int v)
{
    onnx::TensorProto *t = to->add_initializer();
    const onnx_value &value = g->value[v];

    t->set_name(value_name(g, v));
    t->set_data_type(onnx::TensorProto::INT64);
    t->add_dims((int64_t)value.dim[0]);
    for (size_t i = 0; i < value.dim[0]; i++)
        t->add_int64_data(value.ints[i]);
}

/* Name, type and shape of an input or output. */
void describe(onnx::ValueInfoProto *to, const onnx_graph *g, int v)
{
    const onnx_value &value = g->value[v];

    to->set_name(value_name(g, v));
    auto *tensor = to->mutable_type()->mutable_tensor_type();
    tensor->set_elem_type(onnx::TensorProto::FLOAT);
    auto *shape = tensor->mutable_shape();
    for (int i = 0; i < value.ndim; i++)
        shape->add_dim()->set_dim_value((int64_t)value.dim[i]);
}

void add_attribute(onnx::NodeProto *to, const onnx_attribute &from)
{
    onnx::AttributeProto *a = to->add_attribute();

    a->set_name(from.name);
    switch (from.kind) {
    case ONNX_INT:
        a->set_type(onnx::AttributeProto::INT);
        a->set_i(from.list[0]);
        break;
    case ONNX_INT_LIST:
        a->set_type(onnx::AttributeProto::INTS);
        for (size_t i = 0; i < from.count; i++)
            a->add_ints(from.list[i]);
        break;
    case ONNX_REAL:
        a->set_type(onnx::AttributeProto::FLOAT);
        a->set_f(from.real);
        break;
    case ONNX_TEXT:
        a->set_type(onnx::AttributeProto::STRING);
        a->set_s(from.text);
    }
}

void add_nodes(onnx::GraphProto *to, const onnx_graph *g)
{
    for (size_t n = 0; n < g->nodes; n++) {
        const onnx_node &from = g->node[n];
        onnx::NodeProto *node = to->add_node();

        node->set_op_type(from.op);
        node->set_name(std::string(from.op) + "." + std::to_string(n));
        for (size_t i = 0; i < from.inputs; i++)
            node->add_input(value_name(g, from.input[i]));
        for (size_t i = 0; i < from.outputs; i++)
            node->add_output(value_name(g, from.output[i]));
        for (size_t i = 0; i < from.attributes; i++)
            add_attribute(node, from.attribute[i]);
    }
}

std::string serialise(const onnx_graph *g)
{
    onnx::ModelProto model;
    std::string text;

    model.set_ir_version(7);    /* the oldest that has this opset */
    model.set_producer_name("spid-export");
    model.set_producer_version(SPID_VERSION);
    model.set_doc_string(g->about);
    model.add_opset_import()->set_version(ONNX_OPSET);
    onnx::GraphProto *to = model.mutable_graph();
    to->set_name(g->name);
    for (size_t v = 0; v < g->values; v++) {
        if (g->value[v].kind == ONNX_INPUT)
            describe(to->add_input(), g, (int)v);
        else if (g->value[v].kind == ONNX_FLOATS)
            add_floats(to, g->value[v]);
        else if (g->value[v].kind == ONNX_INTS)
            add_ints(to, g, (int)v);
    }
    add_nodes(to, g);
    for (size_t i = 0; i < g->outputs; i++)
        describe(to->add_output(), g, g->output[i]);
    model.SerializeToString(&text);
    return text;
}

} // namespace

int onnx_write(const char *path, const struct onnx_graph *g,
               struct error *err)
{
    struct outfile out = {};
    std::string text;

    try {
        text = serialise(g);
    } catch (const std::exception &) {
        return error_set(err, EX_OSERR, "out of memory for network %s",
                         g->name);
    }
    if (outfile_open(&out, path, err))
        return -1;
    fwrite(text.data(), 1, text.size(), out.file);
    return outfile_close(&out, err);
}
