/* A registered head: the scans' shapes on our template, its rig fitted to
 * them, in place of what the sculptor made. */
#ifndef SPID_LAB_HEAD_TRANSFER_H
#define SPID_LAB_HEAD_TRANSFER_H

#include "lib/lab/head/register.h"

enum { TRANSFER_EXTRA = 24 };   /* directions of skull and neck */

/* Rewrite s (which r was made from) as the head of the scans:
 *  v_template  the matched points of the neutral face; eyeballs as spheres
 *  shapedirs   0..99 the scans' identities, then 24 of what the sculpted
 *              head varies where they end or say little (skull, neck), the
 *              rest 0; expressions in lib/head/arkit.h's order, 0 where a
 *              joint or lid does it, and from ARKIT_COUNT on
 *  weights, J_regressor, posedirs, lids, landmarks  fitted to them. */
int transfer_head(struct sculpt *s, const struct registration *r,
                  struct error *err);

/* ---- parts, for transfer_head -------------------------------------------- */

/* Columns first.. of s->shapedirs (of `columns`), from mask (nv) times its
 * present columns of identity, the strongest principal components of them. */
int transfer_extras(struct sculpt *s, size_t first, size_t count,
                    const double *mask, struct error *err);

/* Lids that close for everyone: lib/lab/head/scan_lids.h on our vertices. */
int transfer_lids(struct sculpt *s, const struct registration *r,
                  struct error *err);

/* Weights, joints, pose correctives and lids, from the expressions
 * (ARKIT_COUNT,nv,3) on our vertices. */
int transfer_rig(struct sculpt *s, const double *expressions,
                 struct error *err);

#endif
