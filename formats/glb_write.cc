/* glTF 2.0 written through tinygltf: Gaussians, and the skinned, morphed,
 * animated head. */
extern "C" {
#include "formats/glb.h"
}

#include <sysexits.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <string>
#include <vector>

#include "formats/glb_guard.hh"
extern "C" {
#include "formats/outfile.h"
#include "lib/base/gaussians.h"
}

using namespace tinygltf;

namespace {

const float STILL = 1e-7f;                /* metres: a vertex that stays */

/* ---- building blocks ---------------------------------------------------- */

/* Append bytes to the one buffer as a view of their own, 4-byte aligned. */
int add_view(Model &m, const void *data, size_t bytes, int target)
{
    std::vector<unsigned char> &b = m.buffers[0].data;
    b.resize((b.size() + 3) / 4 * 4);
    BufferView v;
    v.buffer = 0;
    v.byteOffset = b.size();
    v.byteLength = bytes;
    v.target = target;
    const unsigned char *p = static_cast<const unsigned char *>(data);
    b.insert(b.end(), p, p + bytes);
    m.bufferViews.push_back(v);
    return static_cast<int>(m.bufferViews.size()) - 1;
}

/* min and max of the stored values, component by component. */
void set_bounds(Accessor &a, const float *x, size_t n)
{
    size_t c = static_cast<size_t>(components(a.type));
    for (size_t k = 0; k < c; k++) {
        float lo = n ? x[k] : 0, hi = lo;
        for (size_t i = 1; i < n; i++) {
            lo = std::min(lo, x[i * c + k]);
            hi = std::max(hi, x[i * c + k]);
        }
        a.minValues.push_back(lo);
        a.maxValues.push_back(hi);
    }
}

/* n elements, their bounds if viewers need them; returns its index. */
int add_accessor(Model &m, const void *data, size_t n, int component_type,
                 int type, int target, bool bounds)
{
    size_t bytes = n * static_cast<size_t>(components(type)) *
                   static_cast<size_t>(GetComponentSizeInBytes(
                       static_cast<uint32_t>(component_type)));
    Accessor a;
    a.bufferView = add_view(m, data, bytes, target);
    a.componentType = component_type;
    a.type = type;
    a.count = n;
    if (bounds)
        set_bounds(a, static_cast<const float *>(data), n);
    m.accessors.push_back(a);
    return static_cast<int>(m.accessors.size()) - 1;
}

/* An accessor over x. */
int add_floats(Model &m, const std::vector<float> &x, int type, int target,
               bool bounds)
{
    return add_accessor(m, x.data(),
                        x.size() / static_cast<size_t>(components(type)),
                        TINYGLTF_COMPONENT_TYPE_FLOAT, type, target, bounds);
}

/* An empty model with one scene and one buffer. */
void model_start(Model &m)
{
    m.asset.version = "2.0";
    m.asset.generator = "SpiD toolkit";
    m.buffers.emplace_back();
    m.defaultScene = 0;
    m.scenes.emplace_back();
}

/* Made in memory: the library does not notice a disk that is full. */
int save(Model &m, const char *path, struct error *err)
{
    std::vector<unsigned char> &b = m.buffers[0].data;
    std::ostringstream text;
    struct outfile o;
    TinyGLTF writer;
    b.resize((b.size() + 3) / 4 * 4);
    if (!writer.WriteGltfSceneToStream(&m, text, false, true))
        return error_set(err, EX_SOFTWARE, "%s: no glTF was made", path);
    if (outfile_open(&o, path, err))
        return -1;
    const std::string glb = text.str();
    std::fwrite(glb.data(), 1, glb.size(), o.file);
    return outfile_close(&o, err);
}

/* EX_DATAERR with the first index that is not finite. */
int check_finite(const char *path, const char *what, const float *x, size_t n,
                 struct error *err)
{
    for (size_t i = 0; i < n; i++)
        if (!std::isfinite(x[i]))
            return error_set(err, EX_DATAERR,
                             "%s: %s is not finite at index %zu", path, what,
                             i);
    return 0;
}

/* sRGB, 0 to 1, decoded. */
double to_linear(double c)
{
    c = std::min(1.0, std::max(0.0, c));
    return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

/* ---- Gaussians ---------------------------------------------------------- */

/* Lengths in metres, rotations x,y,z,w, colours as degree 0, and COLOR_0 for
 * other viewers. */
void splat_attributes(Model &m, Primitive &p, const gaussians *g, float unit)
{
    std::vector<float> mean(3 * g->n), scale(3 * g->n), rotation(4 * g->n),
        sh(3 * g->n), rgba(4 * g->n);
    for (size_t i = 0; i < g->n; i++) {
        const float *q = g->quat + 4 * i;
        double length = std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] +
                                  double(q[2]) * q[2] + double(q[3]) * q[3]);
        const double turn[4] = {q[1] / length, q[2] / length, q[3] / length,
                                q[0] / length};
        for (size_t k = 0; k < 4; k++)     /* a zero quaternion turns nothing */
            rotation[4 * i + k] = float(length > 0 ? turn[k] : k == 3);
        for (size_t k = 0; k < 3; k++) {
            const float c = gaussians_channel(g, i, k);
            mean[3 * i + k] = g->mean[3 * i + k] * unit;
            scale[3 * i + k] = g->scale[3 * i + k] * unit;
            sh[3 * i + k] = float((c - 0.5) / GAUSSIAN_SH0);
            rgba[4 * i + k] = float(to_linear(c));
        }
        rgba[4 * i + 3] = g->opacity[i];
    }
    const int F = TINYGLTF_COMPONENT_TYPE_FLOAT;
    const int A = TINYGLTF_TARGET_ARRAY_BUFFER;
    const std::string prefix = std::string(EXTENSION) + ":";
    p.attributes["POSITION"] =
        add_floats(m, mean, TINYGLTF_TYPE_VEC3, A, true);
    p.attributes[prefix + "ROTATION"] =
        add_floats(m, rotation, TINYGLTF_TYPE_VEC4, A, false);
    p.attributes[prefix + "SCALE"] =
        add_floats(m, scale, TINYGLTF_TYPE_VEC3, A, false);
    p.attributes[prefix + "OPACITY"] =
        add_accessor(m, g->opacity, g->n, F, TINYGLTF_TYPE_SCALAR, A, false);
    p.attributes[prefix + "SH_DEGREE_0_COEF_0"] =
        add_floats(m, sh, TINYGLTF_TYPE_VEC3, A, false);
    p.attributes["COLOR_0"] =
        add_floats(m, rgba, TINYGLTF_TYPE_VEC4, A, false);
}

/* Before anything is written. */
int check_splats(const char *path, const gaussians *g, struct error *err)
{
    if (!g->n)
        return error_set(err, EX_DATAERR, "%s: no Gaussians", path);
    for (size_t i = 0; i < 3 * g->n; i++)
        if (!std::isfinite(gaussians_channel(g, i / 3, i % 3)))
            return error_set(err, EX_DATAERR, "%s: the colour of Gaussian %zu "
                             "is not finite", path, i / 3);
    return check_finite(path, "mean", g->mean, 3 * g->n, err) ||
                   check_finite(path, "scale", g->scale, 3 * g->n, err) ||
                   check_finite(path, "quat", g->quat, 4 * g->n, err) ||
                   check_finite(path, "opacity", g->opacity, g->n, err)
               ? -1 : 0;
}

/* glb_write_splats, with tinygltf's exceptions. */
int write_splats(const char *path, const gaussians *g, float unit,
                 struct error *err)
{
    Model m;
    Primitive p;
    Mesh mesh;
    Node node;

    if (check_splats(path, g, err))
        return -1;
    model_start(m);
    splat_attributes(m, p, g, unit);
    p.mode = TINYGLTF_MODE_POINTS;
    p.extensions[EXTENSION] = Value(Value::Object{
        {"kernel", Value(std::string("ellipse"))},
        {"colorSpace", Value(std::string("srgb_rec709_display"))}});
    mesh.name = "gaussians";
    mesh.primitives.push_back(p);
    m.meshes.push_back(mesh);
    node.name = "gaussians";
    node.mesh = 0;
    m.nodes.push_back(node);
    m.scenes[0].nodes.push_back(0);
    m.extensionsUsed.push_back(EXTENSION);
    return save(m, path, err);
}

/* ---- the head ----------------------------------------------------------- */

/* The four largest weights of each vertex, renormalised; an unused slot names
 * joint 0 with weight 0. */
void add_skinning(Model &m, Primitive &p, const glb_head *h)
{
    std::vector<uint8_t> joint(4 * h->V);
    std::vector<float> weight(4 * h->V);
    for (size_t v = 0; v < h->V; v++) {
        const float *w = h->weights + GLB_JOINTS * v;
        int order[GLB_JOINTS] = {0, 1, 2, 3, 4};
        std::stable_sort(order, order + GLB_JOINTS,
                         [w](int a, int b) { return w[a] > w[b]; });
        float sum = 0;
        for (int k = 0; k < 4; k++)
            sum += std::max(0.0f, w[order[k]]);
        for (size_t k = 0; k < 4; k++) {
            float x = std::max(0.0f, w[order[k]]) / sum;
            weight[4 * v + k] = x;
            joint[4 * v + k] = uint8_t(x > 0 ? order[k] : 0);
        }
    }
    p.attributes["JOINTS_0"] = add_accessor(
        m, joint.data(), h->V, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE,
        TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER, false);
    p.attributes["WEIGHTS_0"] =
        add_floats(m, weight, TINYGLTF_TYPE_VEC4,
                   TINYGLTF_TARGET_ARRAY_BUFFER, false);
}

/* 16 bits where they suffice. */
int add_indices(Model &m, const glb_head *h)
{
    size_t n = 3 * h->F;
    if (h->V < 65535) {
        std::vector<uint16_t> f(n);
        for (size_t i = 0; i < n; i++)
            f[i] = uint16_t(h->faces[i]);
        return add_accessor(m, f.data(), n,
                            TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
                            TINYGLTF_TYPE_SCALAR,
                            TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER, false);
    }
    return add_accessor(m, h->faces, n, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                        TINYGLTF_TYPE_SCALAR,
                        TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER, false);
}

/* A morph target: sparse where fewer than half of the vertices move. */
int add_target(Model &m, const float *delta, size_t V)
{
    std::vector<uint16_t> index;
    std::vector<float> value, all(delta, delta + 3 * V);
    for (size_t v = 0; v < V; v++) {
        const float *d = delta + 3 * v;
        if (std::fabs(d[0]) <= STILL && std::fabs(d[1]) <= STILL &&
            std::fabs(d[2]) <= STILL) {
            all[3 * v] = all[3 * v + 1] = all[3 * v + 2] = 0;
            continue;
        }
        index.push_back(uint16_t(v));
        value.insert(value.end(), d, d + 3);
    }
    if (V > 65535 || index.empty() || 2 * index.size() >= V)
        return add_floats(m, all, TINYGLTF_TYPE_VEC3,
                          TINYGLTF_TARGET_ARRAY_BUFFER, true);
    Accessor a;
    a.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
    a.type = TINYGLTF_TYPE_VEC3;
    a.count = V;
    set_bounds(a, all.data(), V);
    a.sparse.isSparse = true;
    a.sparse.count = static_cast<int>(index.size());
    a.sparse.indices.byteOffset = 0;   /* tinygltf leaves them as they are */
    a.sparse.values.byteOffset = 0;
    a.sparse.indices.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    a.sparse.indices.bufferView =
        add_view(m, index.data(), index.size() * sizeof index[0], 0);
    a.sparse.values.bufferView =
        add_view(m, value.data(), value.size() * sizeof value[0], 0);
    m.accessors.push_back(a);
    return static_cast<int>(m.accessors.size()) - 1;
}

/* The picture, its sampler and the material's reference. */
void add_texture(Model &m, Primitive &p, const glb_head *h)
{
    Image image;
    image.mimeType = "image/png";
    image.bufferView = add_view(m, h->png, h->png_bytes, 0);
    m.images.push_back(image);
    Sampler sampler;
    sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
    sampler.wrapS = sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
    m.samplers.push_back(sampler);
    Texture texture;
    texture.sampler = texture.source = 0;
    m.textures.push_back(texture);
    m.materials[0].pbrMetallicRoughness.baseColorTexture.index = 0;
    p.attributes["TEXCOORD_0"] = add_accessor(
        m, h->uv, h->V, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC2,
        TINYGLTF_TARGET_ARRAY_BUFFER, false);
}

/* Vertices, skin weights, morph targets, material. */
void add_mesh(Model &m, const glb_head *h)
{
    Primitive p;
    Mesh mesh;
    Material material;
    const int F = TINYGLTF_COMPONENT_TYPE_FLOAT;
    const int A = TINYGLTF_TARGET_ARRAY_BUFFER;

    material.name = "skin";
    material.pbrMetallicRoughness.metallicFactor = 0;
    material.pbrMetallicRoughness.roughnessFactor = 0.7;
    m.materials.push_back(material);
    p.mode = TINYGLTF_MODE_TRIANGLES;
    p.material = 0;
    p.attributes["POSITION"] = add_accessor(m, h->position, h->V, F,
                                            TINYGLTF_TYPE_VEC3, A, true);
    p.attributes["NORMAL"] = add_accessor(m, h->normal, h->V, F,
                                          TINYGLTF_TYPE_VEC3, A, false);
    add_skinning(m, p, h);
    p.indices = add_indices(m, h);
    if (h->uv && h->png)
        add_texture(m, p, h);
    Value::Array names;
    for (size_t k = 0; k < h->targets; k++) {
        p.targets.push_back({{"POSITION", add_target(m, h->target_delta[k],
                                                     h->V)}});
        names.push_back(Value(std::string(h->target_name[k])));
        mesh.weights.push_back(0);
    }
    mesh.name = "head";
    if (h->targets)
        mesh.extras = Value(Value::Object{{"targetNames", Value(names)}});
    mesh.primitives.push_back(p);
    m.meshes.push_back(mesh);
}

/* Nodes 0..4 are the joints, 5 the mesh, 6 the camera. */
void add_nodes(Model &m, const glb_head *h)
{
    static const char *const name[GLB_JOINTS] = {"root", "neck", "jaw",
                                                 "eye_left", "eye_right"};
    Skin skin;
    std::vector<float> inverse;
    for (int j = 0; j < GLB_JOINTS; j++) {
        const float *J = h->joints + 3 * j;
        const float zero[3] = {0, 0, 0};
        const float *P = h->parents[j] < 0 ? zero
                                           : h->joints + 3 * h->parents[j];
        Node node;
        node.name = name[j];
        node.translation = {J[0] - P[0], J[1] - P[1], J[2] - P[2]};
        m.nodes.push_back(node);
        if (h->parents[j] >= 0)
            m.nodes[size_t(h->parents[j])].children.push_back(j);
        skin.joints.push_back(j);
        const float ibm[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0,
                               -J[0], -J[1], -J[2], 1};
        inverse.insert(inverse.end(), ibm, ibm + 16);
    }
    skin.skeleton = 0;
    skin.inverseBindMatrices =
        add_floats(m, inverse, TINYGLTF_TYPE_MAT4, 0, false);
    m.skins.push_back(skin);
    Node body;
    body.name = "head";
    body.mesh = 0;
    body.skin = 0;
    m.nodes.push_back(body);
    m.scenes[0].nodes = {0, GLB_JOINTS};
}

/* The source camera, looking along -z. */
void add_camera(Model &m, const glb_head *h)
{
    Camera camera;
    Node node;
    camera.type = "perspective";
    camera.perspective.yfov = h->yfov;
    camera.perspective.aspectRatio = 1;
    camera.perspective.znear = 0.01;
    camera.perspective.zfar = 100;
    m.cameras.push_back(camera);
    node.name = "camera";
    node.camera = 0;
    m.nodes.push_back(node);
    m.scenes[0].nodes.push_back(GLB_JOINTS + 1);
}

/* One animated property of a node, linear between frames. */
void add_channel(Model &m, Animation &a, int input, int output, int node,
                 const char *path)
{
    (void)m;
    AnimationSampler sampler;
    AnimationChannel channel;
    sampler.input = input;
    sampler.output = output;
    sampler.interpolation = "LINEAR";
    channel.sampler = static_cast<int>(a.samplers.size());
    channel.target_node = node;
    channel.target_path = path;
    a.samplers.push_back(sampler);
    a.channels.push_back(channel);
}

/* Quaternions of one joint over time, each on the near side of the last. */
std::vector<float> joint_track(const glb_head *h, int j)
{
    std::vector<float> out(4 * h->frames);
    for (size_t t = 0; t < h->frames; t++) {
        const float *q = h->rotation + (t * GLB_JOINTS + size_t(j)) * 4;
        float *o = &out[4 * t], dot = 0;
        for (int k = 0; t && k < 4; k++)
            dot += q[k] * (o - 4)[k];
        for (int k = 0; k < 4; k++)
            o[k] = dot < 0 ? -q[k] : q[k];
    }
    return out;
}

/* Weights, rotations and the head's translation over time. */
void add_animation(Model &m, const glb_head *h)
{
    Animation a;
    const int F = TINYGLTF_COMPONENT_TYPE_FLOAT;
    int time = add_accessor(m, h->time, h->frames, F, TINYGLTF_TYPE_SCALAR,
                            0, true);

    a.name = h->clip;
    if (h->targets)
        add_channel(m, a, time,
                    add_accessor(m, h->target_weight, h->frames * h->targets,
                                 F, TINYGLTF_TYPE_SCALAR, 0, false),
                    GLB_JOINTS, "weights");
    for (int j = 0; j < GLB_JOINTS; j++)
        add_channel(m, a, time,
                    add_floats(m, joint_track(h, j), TINYGLTF_TYPE_VEC4, 0,
                               false),
                    j, "rotation");
    add_channel(m, a, time,
                add_accessor(m, h->translation, h->frames, F,
                             TINYGLTF_TYPE_VEC3, 0, false),
                0, "translation");
    m.animations.push_back(a);
}

/* glb_write_head, with tinygltf's exceptions. */
int write_head(const char *path, const glb_head *h, struct error *err)
{
    Model m;

    if (!h->V || !h->F || h->targets > GLB_MAX_TARGETS)
        return error_set(err, EX_DATAERR,
                         "%s: %zu vertices, %zu faces, %zu morph targets "
                         "(expected some, some, at most %d)", path, h->V,
                         h->F, h->targets, GLB_MAX_TARGETS);
    if (check_finite(path, "position", h->position, 3 * h->V, err))
        return -1;
    model_start(m);
    add_mesh(m, h);
    add_nodes(m, h);
    if (h->yfov > 0)
        add_camera(m, h);
    if (h->frames)
        add_animation(m, h);
    return save(m, path, err);
}

}  // namespace

int glb_write_splats(const char *path, const struct gaussians *g, float unit,
                     struct error *err)
{
    return guarded(path, err, [&] { return write_splats(path, g, unit, err); });
}

int glb_write_head(const char *path, const struct glb_head *h,
                   struct error *err)
{
    return guarded(path, err, [&] { return write_head(path, h, err); });
}
