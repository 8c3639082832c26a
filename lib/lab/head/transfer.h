/* A registered head: the scans' shapes on our template, its rig fitted to
 * them, in place of what it had. */
#ifndef SPID_LAB_HEAD_TRANSFER_H
#define SPID_LAB_HEAD_TRANSFER_H

#include "lib/lab/head/register.h"

/* Rewrite s (which r was made from) as the head of the scans:
 *  v_template  the matched points of the neutral face; eyeballs as spheres
 *  shapedirs   0..99 the scans' identities; those behind them, which scans
 *              lack (skull, neck), stay; expressions in lib/head/arkit.h's order, 0 where a
 *              joint or lid does it, and from ARKIT_COUNT on
 *  weights, J_regressor, posedirs, lids, landmarks  fitted to them. */
int transfer_head(struct template *s, const struct registration *r,
                  struct error *err);

/* ---- parts, for transfer_head -------------------------------------------- */

/* Lids that close for everyone: lib/lab/head/scan_lids.h on our vertices. */
int transfer_lids(struct template *s, const struct registration *r,
                  struct error *err);

/* Weights, joints, pose correctives and lids, from the expressions
 * (ARKIT_COUNT,nv,3) on our vertices. */
int transfer_rig(struct template *s, const double *expressions,
                 struct error *err);

#endif
