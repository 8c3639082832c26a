/* safetensors files: named arrays and a string-to-string metadata map.  Files
 * are hostile input: header length, offsets, overlaps, shapes and dtypes are
 * checked before anything is used. */
#ifndef SPID_FORMATS_SAFETENSORS_H
#define SPID_FORMATS_SAFETENSORS_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "lib/base/error.h"

enum st_dtype {
    ST_U8, ST_I8, ST_I32, ST_I64, ST_F16, ST_BF16, ST_F32, ST_F64,
    ST_BOOL, ST_I16, ST_U16, ST_U32, ST_U64
};

/* Bytes of one number. */
size_t st_dtype_size(enum st_dtype t);
const char *st_dtype_name(enum st_dtype t);  /* "F32", as in the file */

struct st_tensor {
    const char *name;
    enum st_dtype dtype;
    int ndim;                 /* 0 to 8 */
    size_t dim[8];
    size_t count;             /* product of dims */
    const void *data;         /* into the mapped file, read-only; aligned to
                               * 8 bytes only when the writer aligned it */
};

struct safetensors;           /* an open, mapped file */

/* Map and check a file.  NULL on failure; *err names path and tensor. */
struct safetensors *st_open(const char *path, struct error *err);
void st_close(struct safetensors *st);          /* NULL is allowed */
const char *st_path(const struct safetensors *st);

/* How many tensors there are. */
size_t st_count(const struct safetensors *st);
/* The i-th of them from 0; NULL beyond the last. */
const struct st_tensor *st_at(const struct safetensors *st, size_t i);
const struct st_tensor *st_find(const struct safetensors *st,
                                const char *name);     /* NULL: absent */
/* Value of a __metadata__ key, or NULL. */
const char *st_meta(const struct safetensors *st, const char *key);

/* Key and *value of the i-th metadata pair from 0; NULL beyond the last. */
const char *st_meta_at(const struct safetensors *st, size_t i,
                       const char **value);

/* Convert a tensor to float (any floating or integer dtype) into out[count].
 * Fails on NaN or infinity, naming the tensor and the index. */
int st_to_f32(const struct safetensors *st, const struct st_tensor *t,
              float *out, struct error *err);

/* The tensor that must be there with this shape, as floats into out; -1: *err names
 * file, tensor, expected and found shape. */
int st_read_f32(float *out, const struct safetensors *st, const char *name,
                int ndim, const size_t *dims, struct error *err);
/* The same as freshly allocated floats (the caller frees), NULL on failure; a
 * dimension of 0 accepts any size. */
float *st_load_f32(const struct safetensors *st, const char *name, int ndim,
                   const size_t *dims, size_t *count, struct error *err);
/* The same tensor where it lies in the file, valid until st_close, when the
 * file holds aligned F32: *copy is then NULL, and the numbers have not been
 * checked to be finite.  Otherwise converted and checked in *copy (the caller
 * frees). */
const float *st_borrow_f32(const struct safetensors *st, const char *name,
                           int ndim, const size_t *dims, float **copy,
                           struct error *err);
/* An F16 tensor where it lies in the file, valid until st_close: halves that
 * may lie at any address and need not be finite.  NULL on failure. */
const void *st_borrow_f16(const struct safetensors *st, const char *name,
                          int ndim, const size_t *dims, size_t *count,
                          struct error *err);
/* The bytes from .. from + bytes of the mapped file have been used: let their
 * pages go.  Reading them again is allowed, and costs a page fault.  Memory
 * outside of the file is left alone. */
void st_forget(const struct safetensors *st, const void *from, size_t bytes);
/* The same for tensors of any integer type, range-checked to int32. */
int32_t *st_load_i32(const struct safetensors *st, const char *name, int ndim,
                     const size_t *dims, size_t *count, struct error *err);

/* Write a file (beside its final name, then renamed).  Tensors keep the given
 * order; data start 64-byte aligned.  meta is key, value, key, value, NULL. */
int st_save(const char *path, const struct st_tensor *tensors, size_t count,
            const char *const *meta, struct error *err);
/* The same into an open stream, which stays open. */
int st_write(FILE *f, const struct st_tensor *tensors, size_t count,
             const char *const *meta, struct error *err);
/* As st_save, for tensors that are not in memory all at once: where data is
 * NULL, fetch(context, i, err) gives the bytes of tensor i, valid until the
 * next call, or NULL and *err. */
typedef const void *(*st_fetch)(void *context, size_t i, struct error *err);
/* st_save with fetch for the tensors whose data is NULL. */
int st_save_from(const char *path, const struct st_tensor *tensors,
                 size_t count, const char *const *meta, st_fetch fetch,
                 void *context, struct error *err);

#endif
