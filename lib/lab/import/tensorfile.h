/* Files of named tensors as other programs write them: PyTorch checkpoints
 * (zip and the older plain form), numpy's .npy and .npz, pickles of arrays,
 * safetensors.  What a file is, its first bytes say.  Nested dictionaries and
 * lists become dotted names ("model.layer1.0.weight"), objects of any class
 * likewise by what they hold; what is no tensor is left out and counted.  Files
 * are hostile input: see pickle.h, ziparchive.h and the limits below. */
#ifndef SPID_LAB_IMPORT_TENSORFILE_H
#define SPID_LAB_IMPORT_TENSORFILE_H

#include <stddef.h>

#include "formats/arrayview.h"
#include "lib/base/error.h"

#define TENSORFILE_MAX 32768      /* tensors */
#define TENSORFILE_DEPTH 64       /* of values in values */
#define TENSORFILE_NAME 512       /* bytes of a dotted name */
#define TENSORFILE_GROWTH 16      /* bytes of all tensors to bytes of the
                                   * file, unpacked, above.. */
#define TENSORFILE_SMALL ((size_t)64 << 20)

struct tensorfile_tensor {
    const char *name;
    enum st_dtype dtype;
    int ndim;
    size_t dim[ARRAY_VIEW_DIMS];
    size_t count;
};

struct tensorfile;

/* NULL on failure; *err names the file and, inside of it, entry, byte, tensor
 * or opcode. */
struct tensorfile *tensorfile_open(const char *path, struct error *err);
void tensorfile_close(struct tensorfile *f);        /* NULL is allowed */
const char *tensorfile_path(const struct tensorfile *f);
/* "PyTorch zip", "numpy npz", .. */
const char *tensorfile_format(const struct tensorfile *f);
/* XXH3 of all bytes, 128 bits in hex. */
const char *tensorfile_hash(const struct tensorfile *f);

/* How many tensors there are. */
size_t tensorfile_count(const struct tensorfile *f);
/* The i-th of them from 0; NULL beyond the last. */
const struct tensorfile_tensor *tensorfile_at(const struct tensorfile *f,
                                              size_t i);
/* Index of a tensor, or SIZE_MAX. */
size_t tensorfile_find(const struct tensorfile *f, const char *name);
/* The elements of tensor i, row-major and little-endian, valid until the next
 * call; NULL and *err when the file is damaged there. */
const void *tensorfile_data(struct tensorfile *f, size_t i,
                            struct error *err);

/* Values that are no tensors: numbers and text of Python's, and objects that
 * hold none and whose class means nothing here. */
enum tensorfile_sort { TENSORFILE_PLAIN, TENSORFILE_OBJECT, TENSORFILE_SORTS };
#define TENSORFILE_NOTED 64     /* of a sort that are kept by name */
/* How many there are. */
size_t tensorfile_others(const struct tensorfile *f,
                         enum tensorfile_sort sort);
/* The name of the i-th, i < TENSORFILE_NOTED, and its kind ("text") or
 * class. */
const char *tensorfile_other(const struct tensorfile *f,
                             enum tensorfile_sort sort, size_t i,
                             const char **kind);

#endif
