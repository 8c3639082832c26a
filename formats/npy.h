/* NumPy's .npy files, versions 1 and 2: one array each. */
#ifndef SPID_FORMATS_NPY_H
#define SPID_FORMATS_NPY_H

#include <stdbool.h>

#include "formats/arrayview.h"
#include "lib/stream/stream.h"

/* An array in memory of its own. */
struct npy {
    enum dtype dtype;
    int ndim;                  /* 0 to 5 */
    size_t dim[5];
    void *data;                /* row-major; npy_release frees it */
};

/* What the header of a file says. */
struct npy_header {
    char kind;                 /* b i u f; O: Python objects, pickled; or
                                * ?: strings, structures.. */
    size_t size;               /* bytes of an element; O and ?: 0 */
    bool swap, fortran;        /* the other byte order; column-major */
    int ndim;                  /* 0 to 8 */
    size_t dim[8];
    size_t bytes;              /* of the header: data begin here */
};

#define NPY_HEADER_MAX (65536 + 12)

/* Read the header of a file of `bytes` bytes from its first `have`, of which
 * NPY_HEADER_MAX are enough.  The data that follow are, but for O, at least
 * what the shape needs. */
int npy_header_read(struct npy_header *h, const void *head, size_t have,
                    size_t bytes, struct error *err);

/* The view that a header describes; false: no dtype of ours. */
bool npy_view(struct array_view *v, const struct npy_header *h);

/* Read a file of booleans, integers, f2, f4 or f8, either byte order, as
 * array_view_to_stream says; column-major ones are transposed.  Wrong files are
 * refused before anything large is allocated.  Objects (pickles) are never
 * read. */
int npy_load(struct npy *a, const char *path, struct error *err);
/* Free what it holds. */
void npy_release(struct npy *a);

/* A file that grows along a new first axis: open, append rows, close. */
struct npy_writer;
/* Rows of dims (ndim of them) of dtype.  NULL and *err. */
struct npy_writer *npy_create(const char *path, enum dtype dtype, int ndim,
                              const size_t *dims, struct error *err);
/* Append one array of dims. */
int npy_append(struct npy_writer *w, const void *data, struct error *err);
/* Complete the header and take the final name; frees w (NULL is allowed). */
int npy_finish(struct npy_writer *w, struct error *err);
void npy_abandon(struct npy_writer *w);      /* nothing is left; NULL is fine */

#endif
