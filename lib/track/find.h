/* Looking for a face in a whole frame, the first one or one that was lost.  The
 * tracker's own (track.h). */
#ifndef SPID_TRACK_FIND_H
#define SPID_TRACK_FIND_H

#include "lib/track/track.h"

/* The window that a crop is looked for in before it is known where the head
 * is. */
struct square track_window(const struct track *t, struct square crop);

/* A face: the detector's, which is fast, or wherever E_m is sure of one.  1,
 * and it is followed, or before the first frame is done the window is set, too;
 * 0, t is as it was; -1, no detector. */
int track_find(struct track *t, struct track_result *r,
               struct track_effort effort, struct error *err);

#endif
