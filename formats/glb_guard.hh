/* What the parts of formats/glb share. */
#ifndef SPID_FORMATS_GLB_GUARD_HH
#define SPID_FORMATS_GLB_GUARD_HH

#include <sysexits.h>

#include <exception>

#include <tiny_gltf.h>

extern "C" {
#include "lib/base/error.h"
}

const char EXTENSION[] = "KHR_gaussian_splatting";

/* Numbers in an element of this type. */
inline int components(int type)
{
    return tinygltf::GetNumComponentsInType(static_cast<uint32_t>(type));
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
