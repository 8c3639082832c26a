/* What lets a page find a motion in a camera's frames by itself: E_m, and the
 * mean head's landmarks, by which its crop follows the face. */
#ifndef SPID_EXPORT_PAGE_LIVE_H
#define SPID_EXPORT_PAGE_LIVE_H

#include "lib/base/error.h"
#include "lib/export/networks.h"
#include "lib/export/page_pack.h"
#include "lib/head/head.h"

/* "net.motion", the ONNX file; "track.*", the head of those vertices that
 * landmarks hang on (page_pack_head), "track.corner" (68,3) which of them and
 * "track.bary" (68,3) how much of each. */
int page_pack_live(struct pack *k, const struct networks *nets,
                   const struct head *head, struct error *err);

#endif
