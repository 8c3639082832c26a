/* Does an exported file show what we drew?  The file is read back, drawn by
 * our renderer, and compared with our own picture of the same Gaussians. */
#ifndef SPID_EXPORT_DRAWN_H
#define SPID_EXPORT_DRAWN_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/splat/scene.h"

#define DRAWN_SIZE 512          /* pixels of a side */
#define DRAWN_VERTEX_MM 2       /* standard deviation of a mesh's vertices: about
                                 * their spacing on the face */
#define DRAWN_MIN 40          /* dB that a file without rounding must reach */

enum drawn_format {
    DRAWN_PLY, DRAWN_SPLAT, DRAWN_GLB, DRAWN_PLY_PACKED, DRAWN_FORMATS
};

/* How the files of one format compare; zeroed before the first. */
struct drawn {
    size_t files, n;            /* files, Gaussians of the last */
    double psnr_db, max_abs;    /* of the worst file, same rules */
    double viewer_db;           /* the first file drawn by the rules of the
                                 * public rasteriser (dgr), which web viewers
                                 * follow, against our picture */
};

/* Compare a file just written from s, seen by the camera of s or, when it has
 * none, from the front.  turned: a PLY with y down; unit: head units per
 * metre, for GLB.  EX_SOFTWARE when the file has another number of Gaussians
 * or, rounded formats (.splat, compressed PLY) apart, is under
 * DRAWN_MIN. */
int drawn_compare(struct drawn *d, enum drawn_format format, const char *path,
                  const struct scene *s, bool turned, float unit,
                  struct error *err);

/* The same of a GLB of the head, in its first frame. */
struct drawn_head {
    size_t vertices;
    double metres;              /* greatest distance of a vertex from ours */
    double psnr_db, max_abs;    /* of both drawn, vertex by vertex */
};

/* Compare a GLB just written with our own mesh: verts (V,3), metres, in the
 * frame of the file's scene.  EX_SOFTWARE when its faces are others or a
 * vertex is nowhere. */
int drawn_head_compare(struct drawn_head *d, const char *path,
                       const float *verts, const struct head *h,
                       struct error *err);

#endif
