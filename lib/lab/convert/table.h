/* What the kinds share: looking tensors up, noting problems, adding output.
 * Functions return 0, or -1 and *err when memory is short or a file damaged;
 * a tensor that is missing or wrong is noted, and is no error. */
#ifndef SPID_LAB_CONVERT_TABLE_H
#define SPID_LAB_CONVERT_TABLE_H

#include "lib/lab/convert/convert.h"
#include "lib/nn/params.h"

/* Open one more file; its number, or -1. */
int convert_open(struct convert *c, const char *path, struct error *err);

/* Note a problem or a remark. */
void convert_note(struct convert *c, enum convert_problem what,
                  const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* What stands before the name `key` in a file: "model." when it has
 * "model.key" and not "key"; "" when it has neither. */
void convert_prefix(char out[TENSORFILE_NAME], const struct convert *c,
                    int file, const char *key);

/* Find `prefix``from` in a file, which counts as used.  Index, or SIZE_MAX;
 * then, unless optional, it has been noted as missing or, when it has other
 * dimensions, as wrong.  A dimension of 0 fits any. */
size_t convert_find(struct convert *c, int file, const char *prefix,
                    const char *from, int ndim, const size_t *dims,
                    bool optional);
/* The same, written under the name `to` as it is (float64: as float32). */
int convert_take(struct convert *c, int file, const char *prefix,
                 const char *from, const char *to, int ndim,
                 const size_t *dims, struct error *err);
/* Numbers of a tensor as doubles, in room.  NULL and *err. */
double *convert_numbers(struct convert *c, int file, size_t index,
                        struct arena *room, struct error *err);
/* Add an output tensor to fill in, zeroed; owned by c.  NULL and *err. */
void *convert_add(struct convert *c, const char *name, enum st_dtype dtype,
                  int ndim, const size_t *dims, struct error *err);
/* convert_take for every tensor of ps whose name begins with `to`, from the
 * names that have `from` in its place. */
int convert_take_params(struct convert *c, int file, const char *prefix,
                        const struct params *ps, const char *from,
                        const char *to, struct error *err);
/* A pair for the metadata; both are copied. */
void convert_set_meta(struct convert *c, const char *key, const char *value);

/* The kinds.  c->file[0] is open. */
typedef int convert_kind(struct convert *c, struct error *err);
convert_kind convert_flame, convert_dinov2, convert_smirk, convert_gagavatar,
    convert_lam, convert_lpips, convert_arcface, convert_musiq,
    convert_topiq, convert_squeezenet, convert_fan, convert_model;

#endif
