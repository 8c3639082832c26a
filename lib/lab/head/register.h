/* Which point of the scans' neutral face each vertex of the built-in head is.
 * The head's mesh lies on that face: the nearest point that looks the same
 * way. */
#ifndef SPID_LAB_HEAD_REGISTER_H
#define SPID_LAB_HEAD_REGISTER_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/head/scan.h"
#include "lib/lab/head/surface.h"
#include "lib/lab/head/template.h"

/* A vertex is sum_k w_k scan vertex v_k, as far as it is trusted: 1 on the
 * scans' surface, 0 where they end (lower neck) or do not apply (eyeballs). */
struct match {
    int32_t v[3];
    double w[3];
    double trust;
};

struct registration {
    struct arena memory;
    const struct template *s;     /* borrowed */
    const struct scan *scan;
    struct surface mesh;
    size_t *mirror;             /* (nv) the vertex at (-x, y, z) */
    struct match *match;        /* (nv) */
};

/* Of s on the neutral face of scan, both borrowed.  EX_DATAERR when s lies
 * elsewhere. */
int registration_init(struct registration *r, const struct template *s,
                      const struct scan *scan, struct error *err);
/* Free what it holds; zeroed then. */
void registration_release(struct registration *r);

/* out (3) = the matched point in x (SCAN_VERTS,3): neutral or a shape. */
void match_point(double out[3], const struct match *m, const float *x);

#endif
