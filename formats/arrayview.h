/* An array as it lies in somebody else's memory: any element type, byte order
 * and strides, as numpy and PyTorch pickle them, and its elements one after
 * another in our order. */
#ifndef SPID_FORMATS_ARRAYVIEW_H
#define SPID_FORMATS_ARRAYVIEW_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/safetensors.h"
#include "lib/base/error.h"
#include "lib/stream/stream.h"

#define ARRAY_VIEW_DIMS 8

struct array_view {
    enum st_dtype dtype;
    bool swap;                        /* the other byte order */
    int ndim;                         /* 0 to 8 */
    size_t dim[ARRAY_VIEW_DIMS];
    size_t stride[ARRAY_VIEW_DIMS];   /* in elements */
    size_t count;                     /* product of dim */
};

/* numpy's kind ('f') and size (4) as dtype; false: there is none. */
bool array_view_dtype(enum st_dtype *dtype, char kind, size_t size);

/* Set count from dim and strides as in C (row-major) or Fortran.  False: the
 * product does not fit. */
bool array_view_pack(struct array_view *v, bool fortran);

/* Elements that must lie at and behind the view's first one for all of it to
 * be there: 0 when it is empty, SIZE_MAX when the number does not fit. */
size_t array_view_extent(const struct array_view *v);

/* out = the count elements, row-major, little-endian, from data, where the
 * first element lies. */
void array_view_copy(void *out, const struct array_view *v, const void *data);

/* Element i of a packed copy, aligned or not, as a double. */
double array_view_number(enum st_dtype dtype, const void *packed, size_t i);

/* The view of a tensor as safetensors files hold it. */
struct array_view array_view_tensor(const struct st_tensor *t);

/* The elements as the dtype that streams have for them, for the caller to free:
 * booleans are u8, other integers i32, which they must fit, bf16 is f32. */
void *array_view_to_stream(enum dtype *dtype, const struct array_view *v,
                           const void *data, struct error *err);

#endif
