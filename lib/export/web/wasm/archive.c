/* An archive (formats/safetensors.h) handed to the worker, tensor by tensor,
 * in place of a file. */
#include <emscripten.h>

#include "formats/safetensors.h"
#include "lib/export/web/wasm/engine.h"

/* Module.take(name, dtype, shape, bytes); the bytes are the worker's. */
EM_JS(void, archive_take, (const char *name, const char *dtype, int ndim, const size_t *dim,
                           const void *data, size_t bytes), {
    const shape = Array.from(HEAPU32.subarray(dim / 4, dim / 4 + ndim));
    Module.take(UTF8ToString(name), UTF8ToString(dtype), shape,
                HEAPU8.slice(data, data + bytes));
})

EM_JS(void, archive_note, (const char *key, const char *value), {
    Module.note(UTF8ToString(key), UTF8ToString(value));
})

int st_save(const char *path, const struct st_tensor *tensors, size_t count,
            const char *const *meta, struct error *err)
{
    (void)path;
    (void)err;
    for (; meta && meta[0]; meta += 2)
        archive_note(meta[0], meta[1]);
    for (const struct st_tensor *t = tensors; t < tensors + count; t++)
        archive_take(t->name, st_dtype_name(t->dtype), t->ndim, t->dim, t->data,
                     t->count * st_dtype_size(t->dtype));
    return 0;
}
