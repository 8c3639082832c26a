/* --arkit of spid-motion and spid-pack: takes of Live Link Face. */
#ifndef SPID_CMD_TAKE_H
#define SPID_CMD_TAKE_H

#include "formats/livelink.h"
#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/stream/stream.h"

/* 0, or -1 when h has not ARKit's expressions, which a take is made of. */
int take_check_head(const struct head *h, struct error *err);

/* Say what of a take that was read is not used: columns, rows. */
void take_warn(const struct livelink *in, const char *name);

/* Write the take in FILE ("-": standard input) to out: CONF, then MOTN of
 * every frame.  rate as in livelink_open; head_path as in option_head_load.
 * identity (may be NULL): a stream whose source's own motion the take's
 * movements are added to. */
int take_pack(struct stream_writer *out, const char *path, double rate,
              const char *head_path, const char *identity,
              struct error *err);

#endif
