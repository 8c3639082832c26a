/* What lets a page find motions in a camera's frames and make avatars of
 * photographs by itself: the files of model and head, for the engine in
 * lib/export/web/wasm. */
#ifndef SPID_EXPORT_PAGE_LIVE_H
#define SPID_EXPORT_PAGE_LIVE_H

#include "lib/base/error.h"
#include "lib/export/page_pack.h"

/* "engine.model" and "engine.head": the bytes of the two files. */
int page_pack_live(struct pack *k, const char *model, const char *head,
                   struct error *err);

#endif
