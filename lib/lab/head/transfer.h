/* The scans' shapes on the built-in head's mesh. */
#ifndef SPID_LAB_HEAD_TRANSFER_H
#define SPID_LAB_HEAD_TRANSFER_H

#include "lib/lab/head/register.h"

/* The scans' shapes in place of those of s, which r was made from:
 *  shapedirs   0..99 the scans' identities; those behind them, which scans
 *              lack (skull, neck), stay; expressions in lib/head/arkit.h's
 *              order, 0 where a joint or lid does it, and from ARKIT_COUNT on
 *  posedirs, lids  what joints and lids do for the other expressions
 * Mesh, joints, skinning weights and landmarks stay. */
int transfer_head(struct template *s, const struct registration *r,
                  struct error *err);

/* ---- parts, for transfer_head -------------------------------------------- */

/* Lids that close for everyone: lib/lab/head/scan_lids.h on our vertices. */
int transfer_lids(struct template *s, const struct registration *r,
                  struct error *err);

/* Pose correctives and lids, from the expressions (ARKIT_COUNT,nv,3) on our
 * vertices. */
void transfer_rig(struct template *s, const double *expressions);

#endif
