/* Records read ahead: while one is worked on, a thread reads and checks the
 * next.  Results and messages are those of stream_read, in its order. */
#ifndef SPID_STREAM_AHEAD_H
#define SPID_STREAM_AHEAD_H

#include "lib/stream/stream.h"

struct ahead;

/* Read in by a thread from now on; it was opened with options.pair and stays
 * the caller's, who does not read it himself until ahead_close.  NULL: no
 * memory or no thread. */
struct ahead *ahead_open(struct stream_reader *in, struct error *err);

/* stream_read's results; *rec and its data stay valid until the next call. */
int ahead_read(struct ahead *a, const struct record **rec, struct error *err);

/* After ahead_read gave 0 or -1: before that the thread may wait for input for
 * ever. */
void ahead_close(struct ahead *a);

#endif
