/* What the parts of the tensorfile reader share. */
#ifndef SPID_FORMATS_TENSORFILE_IMPL_H
#define SPID_FORMATS_TENSORFILE_IMPL_H

#ifdef __cplusplus
extern "C" {
#endif

#include "formats/pickle.h"
#include "formats/tensorfile.h"
#include "formats/ziparchive.h"

/* Where the elements of a tensor lie: at data, or in an entry of the archive,
 * `skip` bytes from its start. */
struct tensor_place {
    struct array_view view;
    const void *data;               /* NULL: in the entry */
    size_t entry, skip;
};

/* A storage of the older PyTorch form. */
struct legacy_storage {
    struct pickle_text key;
    enum st_dtype dtype;
    const void *data;
    size_t count;
};

struct tensorfile {
    char *path;
    const char *format;
    bool named;                     /* an error while opening names the file */
    char hash[33];
    const unsigned char *map;       /* the file; empty: NULL */
    size_t bytes;
    struct ziparchive *zip;
    struct safetensors *st;
    struct pickle *pickle[2];       /* torch's, or an object array's */
    bool swap;                      /* storages in the other byte order */
    char prefix[256];               /* of a torch archive: "archive/" */
    struct legacy_storage *legacy;  /* by key */
    size_t nlegacy;

    struct tensorfile_tensor *tensor;
    struct tensor_place *place;
    size_t *by_name;                /* once all are known */
    size_t count, room;
    struct {
        char *name;
        const char *kind;
    } other[TENSORFILE_NOTED];
    size_t others;
    void **owned;                   /* blocks that tensors lie in */
    size_t nowned;

    size_t source, total;           /* bytes: unpacked file, all tensors */
    size_t visited;                 /* values, shared ones again */
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
void tensorfile_add_other(struct tensorfile *f, const char *name,
                          const char *kind);
/* A block that lives as long as f. */
void *tensorfile_own(struct tensorfile *f, size_t bytes, struct error *err);

/* Every tensor below a value, under dotted names that begin with `name`. */
int tensorfile_flatten(struct tensorfile *f, const char *name,
                       const struct pickle_value *v, struct error *err);
/* Compressed rows or columns as a full matrix. */
int tensorfile_dense(struct tensor_place *p, struct tensorfile *f,
                     const struct pickle_sparse *s, struct error *err);
/* Where a storage of PyTorch lies. */
int tensorfile_storage(struct tensor_place *p, struct tensorfile *f,
                       const struct pickle_storage *s, struct error *err);

/* A zip archive of PyTorch's, whose tree is entry i; the older form. */
int tensorfile_torch_zip(struct tensorfile *f, size_t i, struct error *err);
/* The older form, whose first pickle ends at `used`. */
int tensorfile_torch_legacy(struct tensorfile *f, size_t used,
                            struct error *err);

#ifdef __cplusplus
}
#endif
#endif
