/* The first frame of an animated glTF head, computed as a viewer would: morph
 * targets, joints, skinning; for checking what glb_write.cc wrote. */
extern "C" {
#include "formats/glb.h"
}

#include <sysexits.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "formats/glb_guard.hh"

using namespace tinygltf;

namespace {

/* Numbers of an accessor that no bytes stand for: 128 MB of them. */
const size_t MAX_ZEROS = size_t(1) << 24;

typedef std::array<double, 12> Matrix;      /* rows of a 3x4 */

const Matrix IDENTITY = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

struct not_there {};    /* an index, a type or a size that cannot be */

/* ---- accessors ---------------------------------------------------------- */

/* v[i], or the file is refused. */
template <typename T> const T &at(const std::vector<T> &v, int i)
{
    if (i < 0 || size_t(i) >= v.size())
        throw not_there();
    return v[size_t(i)];
}

/* One component of an accessor, normalised integers included. */
double number(const unsigned char *p, int type)
{
    uint16_t u16;
    uint32_t u32;
    float f;

    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return *p;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return std::memcpy(&u16, p, 2), u16;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
        return std::memcpy(&u32, p, 4), u32;
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
        return std::memcpy(&f, p, 4), double(f);
    default:
        throw not_there();
    }
}

/* n rows of `width` numbers, one after the other, from a view. */
std::vector<double> numbers(const Model &m, int view, size_t offset, size_t n,
                            size_t width, int type)
{
    const BufferView &v = at(m.bufferViews, view);
    const std::vector<unsigned char> &b = at(m.buffers, v.buffer).data;
    const int bytes = GetComponentSizeInBytes(uint32_t(type));
    if (bytes <= 0)
        throw not_there();
    const size_t one = size_t(bytes);
    const size_t step = v.byteStride ? v.byteStride : one * width;
    const size_t from = v.byteOffset + offset;

    /* before memory is asked for */
    if (from > b.size() || one * width > b.size() - from ||
        (n && n - 1 > (b.size() - from - one * width) / step))
        throw not_there();
    std::vector<double> out(n * width);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < width; k++)
            out[i * width + k] = number(&b[from + i * step + k * one], type);
    return out;
}

/* An accessor's values, sparse ones put in their places. */
std::vector<double> values(const Model &m, int accessor)
{
    const Accessor &a = at(m.accessors, accessor);
    const int components = GetNumComponentsInType(uint32_t(a.type));
    std::vector<double> out;

    if (components <= 0)
        throw not_there();
    const size_t width = size_t(components);
    if (a.bufferView >= 0)
        out = numbers(m, a.bufferView, a.byteOffset, a.count, width,
                      a.componentType);
    else if (a.count <= MAX_ZEROS / width)
        out.assign(a.count * width, 0);
    else
        throw not_there();
    if (!a.sparse.isSparse)
        return out;
    const auto &s = a.sparse;
    const size_t n = size_t(s.count);
    std::vector<double> index =
        numbers(m, s.indices.bufferView, size_t(s.indices.byteOffset), n, 1,
                s.indices.componentType);
    std::vector<double> value =
        numbers(m, s.values.bufferView, size_t(s.values.byteOffset), n, width,
                a.componentType);
    for (size_t i = 0; i < n; i++) {
        if (!(index[i] >= 0 && index[i] < double(a.count)))
            throw not_there();
        std::copy(&value[i * width], &value[i * width] + width,
                  &out[size_t(index[i]) * width]);
    }
    return out;
}

/* A primitive's attribute as numbers; expected: how many there must be. */
std::vector<double> attribute(const Model &m, const Primitive &p,
                              const char *name, size_t expected)
{
    auto found = p.attributes.find(name);
    if (found == p.attributes.end())
        throw not_there();
    std::vector<double> x = values(m, found->second);
    if (expected && x.size() != expected)
        throw not_there();
    return x;
}

/* ---- the scene in its first frame --------------------------------------- */

/* What the animation says at its first keyframe; the node's own otherwise. */
std::vector<double> first(const Model &m, int node, const char *path,
                          const std::vector<double> &otherwise, size_t width)
{
    if (m.animations.empty())
        return otherwise;
    const Animation &a = m.animations[0];
    for (const AnimationChannel &c : a.channels) {
        if (c.target_node != node || c.target_path != path)
            continue;
        std::vector<double> x = values(m, at(a.samplers, c.sampler).output);
        if (x.size() < width)
            throw not_there();
        x.resize(width);
        return x;
    }
    return otherwise;
}

Matrix multiply(const Matrix &a, const Matrix &b)
{
    Matrix c;
    for (size_t i = 0; i < 3; i++)
        for (size_t j = 0; j < 4; j++) {
            c[4 * i + j] = j == 3 ? a[4 * i + 3] : 0;
            for (size_t k = 0; k < 3; k++)
                c[4 * i + j] += a[4 * i + k] * b[4 * k + j];
        }
    return c;
}

Matrix local(const Model &m, int node)
{
    const Node &n = at(m.nodes, node);
    std::vector<double> t = n.translation, q = n.rotation;

    if (!n.matrix.empty() || !n.scale.empty())
        throw not_there();              /* nothing that we write */
    if (t.size() != 3)
        t = {0, 0, 0};
    if (q.size() != 4)
        q = {0, 0, 0, 1};
    t = first(m, node, "translation", t, 3);
    q = first(m, node, "rotation", q, 4);
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    return {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),
            2 * (x * z + y * w), t[0],
            2 * (x * y + z * w), 1 - 2 * (x * x + z * z),
            2 * (y * z - x * w), t[1],
            2 * (x * z - y * w), 2 * (y * z + x * w),
            1 - 2 * (x * x + y * y), t[2]};
}

/* Where every node is in the scene; left: nodes that were not met yet. */
void place(const Model &m, int node, const Matrix &parent,
           std::vector<Matrix> &world, size_t &left)
{
    if (left-- == 0)
        throw not_there();              /* a node below itself, or twice */
    const Matrix here = multiply(parent, local(m, node));
    world[size_t(node)] = here;
    for (int child : m.nodes[size_t(node)].children)
        place(m, child, here, world, left);
}

/* The skin's matrices: where a joint is, from where it was bound. */
std::vector<Matrix> joints(const Model &m, const Skin &s)
{
    std::vector<Matrix> world(m.nodes.size(), IDENTITY), out;
    std::vector<double> bind = values(m, s.inverseBindMatrices);
    size_t left = m.nodes.size();

    if (bind.size() != 16 * s.joints.size() || m.scenes.empty())
        throw not_there();
    for (int root : m.scenes[0].nodes)
        place(m, root, IDENTITY, world, left);
    for (size_t j = 0; j < s.joints.size(); j++) {
        Matrix b;                       /* glTF's are by columns */
        for (size_t i = 0; i < 12; i++)
            b[i] = bind[16 * j + 4 * (i % 4) + i / 4];
        out.push_back(multiply(at(world, s.joints[j]), b));
    }
    return out;
}

/* Rest positions and morph targets by their weights. */
std::vector<double> morphed(const Model &m, int node, const Mesh &mesh)
{
    const Primitive &p = at(mesh.primitives, 0);
    std::vector<double> x = attribute(m, p, "POSITION", 0);
    std::vector<double> w = mesh.weights;

    w.resize(p.targets.size());
    w = first(m, node, "weights", w, w.size());
    for (size_t k = 0; k < w.size(); k++) {
        auto found = p.targets[k].find("POSITION");
        if (found == p.targets[k].end())
            continue;
        std::vector<double> d = values(m, found->second);
        if (d.size() != x.size())
            throw not_there();
        for (size_t i = 0; i < x.size(); i++)
            x[i] += w[k] * d[i];
    }
    return x;
}

/* Morphed vertices under their four joints. */
void skinned(float *out, const Model &m, const Node &n, int node)
{
    const Mesh &mesh = at(m.meshes, n.mesh);
    const Primitive &p = at(mesh.primitives, 0);
    const std::vector<Matrix> turn = joints(m, at(m.skins, n.skin));
    const std::vector<double> x = morphed(m, node, mesh);
    const size_t V = x.size() / 3;
    const std::vector<double> joint = attribute(m, p, "JOINTS_0", 4 * V);
    const std::vector<double> weight = attribute(m, p, "WEIGHTS_0", 4 * V);

    for (size_t v = 0; v < V; v++)
        for (size_t i = 0; i < 3; i++) {
            double sum = 0;
            for (size_t k = 4 * v; k < 4 * v + 4; k++) {
                if (!(joint[k] >= 0 && joint[k] < double(turn.size())))
                    throw not_there();
                const Matrix &t = turn[size_t(joint[k])];
                sum += weight[k] * (t[4 * i] * x[3 * v] +
                                    t[4 * i + 1] * x[3 * v + 1] +
                                    t[4 * i + 2] * x[3 * v + 2] +
                                    t[4 * i + 3]);
            }
            out[3 * v + i] = float(sum);
        }
}

/* glb_read_posed, with tinygltf's exceptions. */
int read_posed(float *verts, int32_t *faces, size_t V, size_t F,
               const char *path, struct error *err)
{
    Model m;
    std::string problem;

    if (!load(&m, &problem, path))
        return error_set(err, EX_DATAERR, "%s: not a GLB file", path);
    for (size_t i = 0; i < m.nodes.size(); i++) {
        const Node &n = m.nodes[i];
        if (n.mesh < 0 || n.skin < 0)
            continue;
        const Primitive &p = at(at(m.meshes, n.mesh).primitives, 0);
        attribute(m, p, "POSITION", 3 * V);
        std::vector<double> f = values(m, p.indices);
        if (f.size() != 3 * F)
            throw not_there();
        for (double corner : f)
            if (!(corner >= 0 && corner < double(V)))
                throw not_there();
        std::copy(f.begin(), f.end(), faces);
        skinned(verts, m, n, int(i));
        return 0;
    }
    throw not_there();
}

}  // namespace

int glb_read_posed(float *verts, int32_t *faces, size_t V, size_t F,
                   const char *path, struct error *err)
{
    return guarded(path, err, [&] {
        try {
            return read_posed(verts, faces, V, F, path, err);
        } catch (const not_there &) {
            return error_set(err, EX_DATAERR, "%s: no skinned mesh of %zu "
                             "vertices and %zu faces that could be posed",
                             path, V, F);
        }
    });
}
