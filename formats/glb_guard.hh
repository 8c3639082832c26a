/* What the two halves of formats/glb share. */
#ifndef SPID_FORMATS_GLB_GUARD_HH
#define SPID_FORMATS_GLB_GUARD_HH

#include <sysexits.h>

#include <exception>

#include <tiny_gltf.h>

extern "C" {
#include "lib/base/error.h"
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
