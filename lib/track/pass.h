/* One pass of E_m: a crop of the frame in, a motion out, and the crop that its
 * head asks for next.  The tracker's own (track.h); crops are squares of window
 * pixels. */
#ifndef SPID_TRACK_PASS_H
#define SPID_TRACK_PASS_H

#include "lib/track/track.h"

/* The paper's line: r's motion and confidence of the picture in one crop;
 * follows: it is that of the last crop's face a frame later. */
void track_encode(struct track *t, struct track_result *r, struct square crop,
                  bool follows);

/* The crop that the projected head asks for. */
struct square track_next_crop(struct track *t, const struct motion *m);

/* Share of a crop that lies in the picture. */
double track_visible(const struct track *t, struct square crop);

/* NULL, or why m, which asks for the crop `next`, cannot be the head that was in
 * the crop `used`. */
const char *track_implausible(const struct track *t, const struct motion *m,
                              struct square next, struct square used);

/* Passes from a first guess until the crop is the one that its own projection
 * asks for, which t then follows; a projection further from a pass's crop than a
 * head moves in a frame is not followed.  seen: the guess is the crop that E_m
 * saw last, in another window. */
void track_settle(struct track *t, struct track_result *r,
                  struct square guess, bool seen);

#endif
