/* glTF files read back: Gaussians of KHR_gaussian_splatting, and what a viewer
 * would trip over (spid-export --lint). */
extern "C" {
#include "formats/glb.h"
}

#include <sysexits.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>

#include "formats/glb_guard.hh"
extern "C" {
#include "formats/splats.h"
}

using namespace tinygltf;

namespace {

/* ---- reading ------------------------------------------------------------ */

int read(Model &m, const char *path, struct error *err)
{
    std::string problem;

    if (load(&m, &problem, path))
        return 0;
    for (char &c : problem)
        if (c == '\n')
            c = ' ';
    return error_set(err, EX_DATAERR, "%s: not a glTF file: %s", path,
                     problem.c_str());
}

/* The accessor's floats, or NULL when it is not what is wanted or reaches
 * outside its buffer.  Interleaved views are refused. */
const float *floats(const Model &m, const Primitive &p, const char *name,
                    int type, size_t n)
{
    auto at = p.attributes.find(name);
    if (at == p.attributes.end() || at->second < 0 ||
        size_t(at->second) >= m.accessors.size())
        return nullptr;
    const Accessor &a = m.accessors[size_t(at->second)];
    if (a.type != type || a.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT ||
        a.count != n || a.bufferView < 0 ||
        size_t(a.bufferView) >= m.bufferViews.size())
        return nullptr;
    const BufferView &v = m.bufferViews[size_t(a.bufferView)];
    size_t width = size_t(components(type)) * sizeof(float);
    if (v.buffer < 0 || size_t(v.buffer) >= m.buffers.size() ||
        (v.byteStride && v.byteStride != width))
        return nullptr;
    const std::vector<unsigned char> &b = m.buffers[size_t(v.buffer)].data;
    size_t from = v.byteOffset + a.byteOffset;
    if (from % 4 || from > b.size() || n > (b.size() - from) / width)
        return nullptr;
    return reinterpret_cast<const float *>(b.data() + from);
}

/* The first primitive with the extension. */
const Primitive *find_splats(const Model &m)
{
    for (const Mesh &mesh : m.meshes)
        for (const Primitive &p : mesh.primitives)
            if (p.extensions.count(EXTENSION))
                return &p;
    return nullptr;
}

struct splat_view {
    const float *mean, *scale, *rotation, *opacity, *sh;
    size_t n;
};

/* The accessors, when all are there and of one length. */
bool view_splats(splat_view *v, const Model &m, const Primitive &p)
{
    auto at = p.attributes.find("POSITION");
    if (at == p.attributes.end() || at->second < 0 ||
        size_t(at->second) >= m.accessors.size())
        return false;
    v->n = m.accessors[size_t(at->second)].count;
    const std::string x = std::string(EXTENSION) + ":";
    const int V3 = TINYGLTF_TYPE_VEC3, V4 = TINYGLTF_TYPE_VEC4;
    v->mean = floats(m, p, "POSITION", V3, v->n);
    v->scale = floats(m, p, (x + "SCALE").c_str(), V3, v->n);
    v->rotation = floats(m, p, (x + "ROTATION").c_str(), V4, v->n);
    v->opacity = floats(m, p, (x + "OPACITY").c_str(), TINYGLTF_TYPE_SCALAR,
                        v->n);
    v->sh = floats(m, p, (x + "SH_DEGREE_0_COEF_0").c_str(), V3, v->n);
    return v->mean && v->scale && v->rotation && v->opacity && v->sh;
}

/* glb_read_splats, with tinygltf's exceptions. */
int read_splats(splats *s, float unit, const char *path, struct error *err)
{
    Model m;
    splat_view v;

    if (read(m, path, err))
        return -1;
    const Primitive *p = find_splats(m);
    if (!p || !view_splats(&v, m, *p))
        return error_set(err, EX_DATAERR,
                         "%s: no complete %s primitive in float accessors",
                         path, EXTENSION);
    if (splats_allocate(s, v.n, 0, path, err))
        return -1;
    std::copy(v.opacity, v.opacity + v.n, s->opacity);
    for (size_t i = 0; i < v.n; i++) {
        s->quat[4 * i] = v.rotation[4 * i + 3];
        std::copy(v.rotation + 4 * i, v.rotation + 4 * i + 3,
                  s->quat + 4 * i + 1);
        for (size_t k = 3 * i; k < 3 * i + 3; k++) {
            s->mean[k] = v.mean[k] * unit;
            s->scale[k] = v.scale[k] * unit;
            s->color[k] = float(v.sh[k] * GAUSSIAN_SH0 + 0.5);
        }
    }
    return 0;
}

/* ---- lint --------------------------------------------------------------- */

struct lint {
    void (*say)(void *, const char *);
    void *context;
    int found;
    void operator()(const std::string &text)
    {
        say(context, text.c_str());
        found++;
    }
};

/* Attributes that viewers without the extension need. */
void lint_splats(lint &l, const Model &m, const Primitive &p)
{
    splat_view v;
    if (p.mode != TINYGLTF_MODE_POINTS)
        l("Gaussians are not of mode 0 (points): viewers without the "
          "extension draw triangles of nonsense");
    if (!p.attributes.count("COLOR_0"))
        l("no COLOR_0: viewers without the extension show black points");
    if (!view_splats(&v, m, p)) {
        l("an attribute of the Gaussians is missing, not float, interleaved "
          "or of another length");
        return;
    }
    size_t not_unit = 0, bad_scale = 0, bad_opacity = 0, bad = 0;
    for (size_t i = 0; i < v.n; i++) {
        double q = 0;
        for (size_t k = 0; k < 4; k++)
            q += double(v.rotation[4 * i + k]) * v.rotation[4 * i + k];
        not_unit += !(std::fabs(q - 1) < 1e-4);
        for (size_t k = 0; k < 3; k++) {
            bad_scale += !(v.scale[3 * i + k] >= 0);
            bad += !std::isfinite(v.mean[3 * i + k]);
        }
        bad_opacity += !(v.opacity[i] >= 0 && v.opacity[i] <= 1);
    }
    if (not_unit)
        l(std::to_string(not_unit) + " rotations are not unit quaternions");
    if (bad_scale)
        l(std::to_string(bad_scale) + " scales are negative or not numbers: "
          "are they logarithms? glTF wants linear ones");
    if (bad_opacity)
        l(std::to_string(bad_opacity) + " opacities are outside 0..1: are "
          "they logits? glTF wants linear ones");
    if (bad)
        l(std::to_string(bad) + " coordinates are not finite");
}

/* A part of a sparse accessor: count elements of that width. */
void lint_sparse(lint &l, const Model &m, size_t i, const char *part,
                 int view, int offset, int count, size_t width)
{
    if (view < 0 || size_t(view) >= m.bufferViews.size() || offset < 0 ||
        count < 0 || size_t(offset) + size_t(count) * width >
                         m.bufferViews[size_t(view)].byteLength)
        l("accessor " + std::to_string(i) + ": sparse " + part +
          " reach past their view");
}

/* Sparse accessors and sizes. */
void lint_accessors(lint &l, const Model &m)
{
    for (size_t i = 0; i < m.accessors.size(); i++) {
        const Accessor &a = m.accessors[i];
        if (a.sparse.isSparse) {
            const auto &s = a.sparse;
            auto bytes = [](int type) {
                return size_t(GetComponentSizeInBytes(uint32_t(type)));
            };
            lint_sparse(l, m, i, "indices", s.indices.bufferView,
                        s.indices.byteOffset, s.count,
                        bytes(s.indices.componentType));
            lint_sparse(l, m, i, "values", s.values.bufferView,
                        s.values.byteOffset, s.count,
                        size_t(components(a.type)) * bytes(a.componentType));
        }
        if (a.bufferView < 0 || size_t(a.bufferView) >= m.bufferViews.size())
            continue;
        const BufferView &v = m.bufferViews[size_t(a.bufferView)];
        size_t width = size_t(components(a.type)) *
                       size_t(GetComponentSizeInBytes(
                           uint32_t(a.componentType)));
        size_t step = v.byteStride ? v.byteStride : width;
        if (a.count &&
            a.byteOffset + (a.count - 1) * step + width > v.byteLength)
            l("accessor " + std::to_string(i) + " reaches past its view");
        if ((v.byteOffset + a.byteOffset) %
            size_t(GetComponentSizeInBytes(uint32_t(a.componentType))))
            l("accessor " + std::to_string(i) + " is not aligned");
    }
}

/* Positions with bounds, triangles and points. */
void lint_mesh(lint &l, const Model &m, const Mesh &mesh)
{
    bool triangles = false, splats = false;
    for (const Primitive &p : mesh.primitives) {
        auto at = p.attributes.find("POSITION");
        if (at == p.attributes.end() || at->second < 0 ||
            size_t(at->second) >= m.accessors.size())
            l("mesh '" + mesh.name + "' has a primitive without POSITION");
        else if (m.accessors[size_t(at->second)].minValues.size() != 3)
            l("POSITION of mesh '" + mesh.name + "' has no min and max");
        if (p.targets.size() > 8)
            l("mesh '" + mesh.name + "' has " +
              std::to_string(p.targets.size()) + " morph targets: small "
              "viewers use only the 8 largest weights");
        if (p.extensions.count(EXTENSION)) {
            splats = true;
            lint_splats(l, m, p);
        } else {
            triangles = true;
        }
    }
    if (triangles && splats)
        l("mesh '" + mesh.name + "' mixes Gaussians and triangles");
}

/* Everything that is said about one file. */
int lint_file(const char *path, lint &l, struct error *err)
{
    Model m;

    if (read(m, path, err))
        return -1;
    if (std::count(m.extensionsRequired.begin(), m.extensionsRequired.end(),
                   EXTENSION))
        l("extensionsRequired names KHR_gaussian_splatting: viewers without "
          "it refuse the file instead of showing points");
    if (find_splats(m) && !std::count(m.extensionsUsed.begin(),
                                      m.extensionsUsed.end(), EXTENSION))
        l("extensionsUsed does not name KHR_gaussian_splatting");
    lint_accessors(l, m);
    for (const Mesh &mesh : m.meshes)
        lint_mesh(l, m, mesh);
    return l.found;
}

}  // namespace

int glb_lint(const char *path, void (*say)(void *context, const char *text),
             void *context, struct error *err)
{
    lint l{say, context, 0};
    return guarded(path, err, [&] { return lint_file(path, l, err); });
}

int glb_read_splats(struct splats *s, float unit, const char *path,
                    struct error *err)
{
    *s = {};
    return guarded(path, err, [&] { return read_splats(s, unit, path, err); });
}
