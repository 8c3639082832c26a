/* Element types, byte orders and strides taken apart and put in our order. */
#include "formats/arrayview.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"

bool array_view_dtype(enum st_dtype *dtype, char kind, size_t size)
{
    static const struct {
        char kind;
        size_t size;
        enum st_dtype dtype;
    } known[] = {
        {'b', 1, ST_BOOL}, {'u', 1, ST_U8},  {'u', 2, ST_U16},
        {'u', 4, ST_U32},  {'u', 8, ST_U64}, {'i', 1, ST_I8},
        {'i', 2, ST_I16},  {'i', 4, ST_I32}, {'i', 8, ST_I64},
        {'f', 2, ST_F16},  {'f', 4, ST_F32}, {'f', 8, ST_F64},
    };

    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i].kind == kind && known[i].size == size) {
            *dtype = known[i].dtype;
            return true;
        }
    return false;
}

bool array_view_pack(struct array_view *v, bool fortran)
{
    size_t stride = 1;

    v->count = 1;
    for (int i = 0; i < v->ndim; i++) {
        if (v->dim[i] && v->count > SIZE_MAX / 16 / v->dim[i])
            return false;
        v->count *= v->dim[i];
    }
    for (int i = 0; i < v->ndim; i++) {
        int k = fortran ? i : v->ndim - 1 - i;

        v->stride[k] = stride;
        stride *= v->count ? v->dim[k] : 1;
    }
    return true;
}

size_t array_view_extent(const struct array_view *v)
{
    unsigned __int128 last = 0;

    for (int i = 0; i < v->ndim; i++) {
        if (!v->dim[i])
            return 0;
        last += (unsigned __int128)(v->dim[i] - 1) * v->stride[i];
        if (last >= SIZE_MAX / 16)
            return SIZE_MAX;
    }
    return (size_t)last + 1;
}

static void arrayview_reverse_bytes(unsigned char *p, size_t size, size_t count)
{
    for (; count; count--, p += size)
        for (size_t i = 0; i < size / 2; i++) {
            unsigned char t = p[i];

            p[i] = p[size - 1 - i];
            p[size - 1 - i] = t;
        }
}

/* Elements from the end that lie in order: a run that one memcpy takes. */
static size_t arrayview_packed_run(const struct array_view *v, int *outer)
{
    size_t run = 1;
    int k = v->ndim;

    while (k > 0 && (v->stride[k - 1] == run || v->dim[k - 1] == 1))
        run *= v->dim[--k];
    *outer = k;
    return run;
}

void array_view_copy(void *out, const struct array_view *v, const void *data)
{
    const size_t size = st_dtype_size(v->dtype);
    const unsigned char *from = data;
    unsigned char *to = out;
    size_t index[ARRAY_VIEW_DIMS] = {0}, at = 0;
    int outer;
    size_t run = arrayview_packed_run(v, &outer);

    for (size_t done = 0; done < v->count; done += run) {
        memcpy(to + done * size, from + at * size, run * size);
        for (int k = outer - 1; k >= 0; k--) {
            at += v->stride[k];
            if (++index[k] < v->dim[k])
                break;
            at -= v->dim[k] * v->stride[k];
            index[k] = 0;
        }
    }
    if (v->swap)
        arrayview_reverse_bytes(out, size, v->count);
}

double array_view_number(enum st_dtype dtype, const void *packed, size_t i)
{
    const size_t size = st_dtype_size(dtype);
    union {
        uint8_t u8; int8_t i8; uint16_t u16; int16_t i16; uint32_t u32;
        int32_t i32; uint64_t u64; int64_t i64; float f; double d;
    } v;

    memcpy(&v, (const char *)packed + i * size, size);
    switch (dtype) {
    case ST_BOOL: return v.u8 != 0;
    case ST_U8: return v.u8;
    case ST_U16: return v.u16;
    case ST_U32: return v.u32;
    case ST_U64: return (double)v.u64;
    case ST_I8: return v.i8;
    case ST_I16: return v.i16;
    case ST_I32: return v.i32;
    case ST_I64: return (double)v.i64;
    case ST_F16: return half_to_float(v.u16);
    case ST_BF16: return bf16_to_float(v.u16);
    case ST_F32: return v.f;
    case ST_F64: return v.d;
    }
    return 0;
}

struct array_view array_view_tensor(const struct st_tensor *t)
{
    struct array_view v = {.dtype = t->dtype, .ndim = t->ndim};

    memcpy(v.dim, t->dim, sizeof v.dim);
    array_view_pack(&v, false);
    return v;
}

/* out (n) from packed elements of another dtype. */
static int arrayview_convert(void *out, enum dtype to, enum st_dtype from,
                             const void *packed, size_t n, struct error *err)
{
    for (size_t i = 0; i < n; i++) {
        const double x = array_view_number(from, packed, i);

        if (to == DTYPE_F32)
            ((float *)out)[i] = (float)x;
        else if (x >= INT32_MIN && x <= INT32_MAX)
            ((int32_t *)out)[i] = (int32_t)x;
        else
            return error_set(err, EX_DATAERR, "value %.0f at %zu does not fit "
                             "i32", x, i);
    }
    return 0;
}

void *array_view_to_stream(enum dtype *dtype, const struct array_view *v,
                           const void *data, struct error *err)
{
    static const enum dtype as[] = {
        [ST_U8] = DTYPE_U8, [ST_I8] = DTYPE_I32, [ST_I32] = DTYPE_I32,
        [ST_I64] = DTYPE_I32, [ST_F16] = DTYPE_F16, [ST_BF16] = DTYPE_F32,
        [ST_F32] = DTYPE_F32, [ST_F64] = DTYPE_F64, [ST_BOOL] = DTYPE_U8,
        [ST_I16] = DTYPE_I32, [ST_U16] = DTYPE_I32, [ST_U32] = DTYPE_I32,
        [ST_U64] = DTYPE_I32
    };
    const bool same = v->dtype == ST_I32 || (as[v->dtype] != DTYPE_I32 &&
                                             v->dtype != ST_BF16);
    void *packed = malloc(v->count * st_dtype_size(v->dtype) + 1), *out = NULL;

    *dtype = as[v->dtype];
    if (packed)
        array_view_copy(packed, v, data);
    if (packed && same)
        return packed;
    if (packed)
        out = malloc(v->count * dtype_size(*dtype) + 1);
    if (!out)
        error_set(err, EX_OSERR, "out of memory");
    else if (arrayview_convert(out, *dtype, v->dtype, packed, v->count, err)) {
        free(out);
        out = NULL;
    }
    free(packed);
    return out;
}
