/* What the parts of formats/glb share. */
#ifndef SPID_FORMATS_GLB_GUARD_HH
#define SPID_FORMATS_GLB_GUARD_HH

#include <sysexits.h>

#include <exception>
#include <string>

#include <tiny_gltf.h>

extern "C" {
#include "lib/base/error.h"
#include "lib/base/file.h"
}

const char EXTENSION[] = "KHR_gaussian_splatting";

/* Numbers in an element of this type. */
inline int components(int type)
{
    return tinygltf::GetNumComponentsInType(static_cast<uint32_t>(type));
}

/* .glb or .gltf, with what is wrong; pictures are not decoded: their bytes are
 * none of our business here. */
inline bool load(tinygltf::Model *m, std::string *problem, const char *path)
{
    tinygltf::TinyGLTF reader;
    std::string warning;

    reader.SetImageLoader([](tinygltf::Image *, const int, std::string *,
                             std::string *, int, int, const unsigned char *,
                             int, void *) { return true; }, nullptr);
    return file_ends(path, ".gltf")
        ? reader.LoadASCIIFromFile(m, problem, &warning, path)
        : reader.LoadBinaryFromFile(m, problem, &warning, path);
}

/* Exceptions (out of memory, JSON) stop at the C border. */
template <typename F>
int guarded(const char *path, struct error *err, F body)
{
    try {
        return body();
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "%s: %s", path, e.what());
    }
}

#endif
