/* The person cut out of a picture: the source's matte. */
#ifndef SPID_FORMATS_MATTE_H
#define SPID_FORMATS_MATTE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* Matte [n,n] (255 person, 0 background, soft at the border) of rgb [n,n,3]
 * by GrabCut, from what the projected head says:
 *   head [n,n]  255 where the head model's mesh lands, 0 elsewhere
 *   inside [n,n] 0 where the square lies outside the picture (black); may be
 *                NULL
 * Certainly person: the head, a little smaller; certainly background: far
 * from the head above the shoulders; everything between is for the colours to
 * decide.  Deterministic.  When the result is absurd (almost nothing or almost
 * all), a soft disc about the head is returned instead and *fallback set.
 * EX_DATAERR when the head lies outside the picture. */
int matte_grabcut(uint8_t *matte, bool *fallback, const uint8_t *rgb,
                  const uint8_t *head, const uint8_t *inside, size_t n,
                  struct error *err);

/* Matte [n,n] of rgb [n,n,3] from a coarse one, w by w numbers in [0,1] of the
 * same square, w <= n: what is connected with the head, and the detail that
 * the colours add; where the coarse one is undecided over more than a rim,
 * GrabCut decides, with the rest as seeds.  head and inside as above.  *absurd
 * is set, and the matte left undefined, when the coarse one shows almost
 * nothing of the head or almost nothing else. */
int matte_refine(uint8_t *matte, bool *absurd, const float *coarse, size_t w,
                 const uint8_t *rgb, const uint8_t *head,
                 const uint8_t *inside, size_t n, struct error *err);

/* Matte [n,n] of rgb [n,n,3] by the colour of a plain wall behind the person,
 * evenly lit or not: 255 person, soft where hair and wall mix.  *plain is
 * false, and the matte left undefined, where what surrounds the head is no such
 * wall, else true.  head and inside as above, inside not NULL. */
int matte_wall(uint8_t *matte, bool *plain, const uint8_t *rgb,
               const uint8_t *head, const uint8_t *inside, size_t n,
               struct error *err);

#endif
