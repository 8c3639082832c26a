/* spid-export's work: a stream's Gaussians, meshes and motion as files that
 * other programs open. */
#ifndef SPID_EXPORT_EXPORT_H
#define SPID_EXPORT_EXPORT_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/export/drawn.h"
#include "lib/export/export_head.h"
#include "lib/export/page.h"
#include "lib/head/person.h"
#include "lib/splat/scene.h"
#include "lib/stream/stream.h"

/* What can be written: Gaussians, in the order of enum drawn_format; a mesh;
 * the animated head, the page, and the page's arrays alone. */
enum export_kind {
    EXPORT_PLY, EXPORT_SPLAT, EXPORT_GLB_SPLATS, EXPORT_PLY_PACKED, EXPORT_OBJ,
    EXPORT_GLB_HEAD, EXPORT_HTML, EXPORT_WEB, EXPORT_KINDS
};

/* Where to write; NULL: not asked for.  Up to EXPORT_OBJ a name with a %d
 * conversion (such as face_%06d.ply) makes a file per frame; any other holds
 * the frame chosen. */
struct export_options {
    const char *file[EXPORT_KINDS];
    const char *player;     /* the template that the page is made of */
    long frame;             /* the frame for names without %d; -1: the first */
    bool model_space;       /* PLY: not turned to y down */
    struct export_head_options head;
};

struct export {
    struct export_options opt;
    struct head head;       /* loaded when meshes or the head are wanted */
    struct identity id;
    struct person person;
    struct scene scene;
    struct export_head skinned;
    struct page page;
    size_t page_bytes;      /* of the page written */
    bool has_head, folded;
    size_t files, frames;   /* written; keyframes of the animation */
    bool coarse;            /* feature channels were left behind */
    struct drawn drawn[DRAWN_FORMATS];  /* files read back, by enum drawn_format */
    struct drawn_head drawn_head;
    float *shown;           /* (V,3) the first frame of the animation as we
                             * have it, metres before glTF's camera */
    bool done[EXPORT_KINDS];    /* a file of the kind has been written */
};

/* Check the options (EX_USAGE) and load the head from head_path when the
 * options need it. */
int export_init(struct export *x, const struct export_options *opt,
                const char *head_path, struct error *err);
/* Free what it holds. */
void export_release(struct export *x);

/* True when the options need the head model. */
bool export_needs_head(const struct export_options *opt);

/* Shape, source picture, source motion and, for a page, Gaussians from an
 * identity's file.  Before the first record. */
int export_load_identity(struct export *x, const char *path,
                         struct error *err);

/* Take one record; writes the files that are complete with it, and reads them
 * back into x->drawn. */
int export_record(struct export *x, const struct record *rec,
                  struct error *err);

/* Write what needs the whole stream: the animated head, read back into
 * x->drawn_head, and the page.  -1 also when a file that was asked for could
 * not be made of this stream, naming what lacked. */
int export_finish(struct export *x, struct error *err);

#endif
