/* What the parts of the tensorfile reader share. */
#ifndef SPID_LAB_IMPORT_TENSORFILE_IMPL_H
#define SPID_LAB_IMPORT_TENSORFILE_IMPL_H

#include "lib/base/arena.h"
#include "lib/lab/import/pickle.h"
#include "lib/lab/import/tensorfile.h"
#include "lib/lab/import/ziparchive.h"

/* Where the elements of a tensor lie: at data, or in an entry of the archive,
 * `skip` bytes from its start. */
struct tensor_place {
    struct array_view view;
    const void *data;               /* NULL: in the entry */
    size_t entry, skip;
};

struct tensor_row {
    struct tensorfile_tensor t;
    struct tensor_place place;
};

/* A storage of the older PyTorch form. */
struct legacy_storage {
    struct pickle_text key;
    enum st_dtype dtype;
    const void *data;
    size_t count;
};

struct tensorfile {
    struct arena memory;            /* of names, and what tensors lie in */
    const char *path;
    const char *format;
    bool named;                     /* an error while opening names the file */
    char hash[33];
    const unsigned char *map;       /* the file; empty: NULL */
    size_t bytes;
    struct ziparchive *zip;
    struct safetensors *st;
    struct pickle **pickle;         /* torch's, or object arrays' */
    size_t npickle, pickle_room;
    struct error refused;           /* the first thing that made an object */
    bool swap;                      /* storages in the other byte order */
    char prefix[256];               /* of a torch archive: "archive/" */
    struct legacy_storage *legacy;  /* by key */
    size_t nlegacy;

    struct tensor_row *row;
    size_t *by_name;                /* once all are known */
    size_t count, room;
    struct {
        const char *name[TENSORFILE_NOTED], *kind[TENSORFILE_NOTED];
        size_t n;
    } other[TENSORFILE_SORTS];

    size_t source, total;           /* bytes: unpacked file, all tensors */
    size_t visited;                 /* values, shared ones again */
    int objects;                    /* that the walk is inside of */
    void *cache;                    /* the last entry that was unpacked */
    size_t cached;                  /* its index; SIZE_MAX: none */
    size_t unpacked;                /* bytes, so far */
    void *packed;                   /* the last tensor that was copied */
};

/* 0, or -1 with *err that does not name the file. */

/* One more tensor, at place p; the name is copied. */
int tensorfile_add(struct tensorfile *f, const char *name,
                   const struct tensor_place *p, struct error *err);
/* One more value that is no tensor. */
void tensorfile_add_other(struct tensorfile *f, enum tensorfile_sort sort,
                          const char *name, const char *kind);
/* Read a pickle that lives as long as f; its length in *used (may be NULL).
 * NULL on failure; `where` it lies, f remembers with what it refused. */
struct pickle *tensorfile_unpickle(struct tensorfile *f, const char *where,
                                   const void *data, size_t bytes,
                                   size_t *used, struct error *err);
/* Every tensor in a pickle of f's, under dotted names that begin with `name`.
 */
int tensorfile_flatten(struct tensorfile *f, const char *name,
                       const struct pickle *p, struct error *err);
/* Whether an object is one of scipy's sparse matrices. */
bool tensorfile_is_sparse(const struct pickle_object *o);
/* Such a matrix in full.  1: it has a form of which nothing is known. */
int tensorfile_dense(struct tensor_place *p, struct tensorfile *f,
                     const struct pickle_object *o, struct error *err);
/* An array behind chumpy's wrapping too; NULL: v is none, or is NULL. */
const struct pickle_array *tensorfile_array(const struct pickle_value *v);
/* Where a storage of PyTorch lies. */
int tensorfile_storage(struct tensor_place *p, struct tensorfile *f,
                       const struct pickle_storage *s, struct error *err);

/* A zip archive of PyTorch's, whose tree is entry i; the older form. */
int tensorfile_torch_zip(struct tensorfile *f, size_t i, struct error *err);
/* The older form, whose first pickle ends at `used`. */
int tensorfile_torch_legacy(struct tensorfile *f, size_t used,
                            struct error *err);

#endif
