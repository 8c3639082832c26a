/* Tensors of other people's files under the names and in the shapes that the
 * toolkit loads.  Without a kind everything is taken as it is; with one, what
 * the kind needs is looked for by name, and what is missing, left over or of
 * another shape is noted. */
#ifndef SPID_LAB_CONVERT_CONVERT_H
#define SPID_LAB_CONVERT_CONVERT_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/safetensors.h"
#include "lib/lab/import/tensorfile.h"
#include "lib/base/arena.h"

#define CONVERT_FILES 4
#define CONVERT_META 16

enum convert_problem {
    CONVERT_MISSING, CONVERT_SHAPE, CONVERT_LEFT, CONVERT_REMARK
};

/* A tensor to write: data, or tensor `index` of file number `file`. */
struct convert_tensor {
    char *name;
    enum st_dtype dtype;
    int ndim;
    size_t dim[ARRAY_VIEW_DIMS];
    size_t count;
    void *data;
    int file;
    size_t index;
};

/* Files beside FILE that a kind takes; NULL: not given. */
struct convert_options {
    const char *eyelids;        /* FLAME: one file, or "LEFT,RIGHT" */
    const char *landmarks;      /* FLAME: the landmark embedding */
    const char *linear;         /* LPIPS: the linear weights */
    const char *config;         /* GAGAvatar: its configuration, JSON */
    const char *encoders;       /* GAGAvatar: a model with E_m and E_beta */
    const char *head;           /* the head that models come to fit, */
    const char *from_head;      /* and theirs until now */
};

struct convert {
    struct arena memory;        /* of names, texts and data */
    const struct convert_options *with;     /* what convert_as was given */
    struct tensorfile *file[CONVERT_FILES];   /* borrowed; [0] is FILE */
    bool *used[CONVERT_FILES];
    struct convert_tensor *tensor;
    size_t count, room;
    struct convert_note {
        enum convert_problem what;
        char *text;             /* "a.weight [3] (expected [4])" */
    } *problem;
    size_t problems, problem_room;
    size_t wrong;               /* of them: missing, or of another shape */
    char *meta[2 * CONVERT_META + 1];   /* key, value, .., NULL */
    size_t nmeta;
    void *scratch;              /* of the last tensor that was converted */
};

/* Names of the kinds, ended by NULL. */
extern const char *const convert_kinds[];

/* Everything of f as it is. */
int convert_all(struct convert *c, struct tensorfile *f, struct error *err);
/* As a kind.  -1 and *err on damage and for an unknown kind; otherwise 0,
 * and c->wrong says whether the result is of use. */
int convert_as(struct convert *c, struct tensorfile *f, const char *kind,
               const struct convert_options *o, struct error *err);
/* Write; the metadata name producer, format and hash of the source, kind. */
int convert_save(struct convert *c, const char *path, struct error *err);
/* Releases what c holds and closes the files beside FILE; a zeroed *c is
 * allowed. */
void convert_release(struct convert *c);

#endif
