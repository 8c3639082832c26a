/* How many threads share the work: a count that is taken once and is the same
 * for everything planned, in whichever thread. */
#ifndef SPID_BASE_PARALLEL_H
#define SPID_BASE_PARALLEL_H

#include <stddef.h>

/* Set it, before anything is planned; what was planned with another count must
 * not be run any more. */
void parallel_set_width(int threads);

/* The count: what was set, or processors_allowed().  Room for one part a thread
 * is sized by it. */
int parallel_width(void);

/* In a thread of its own, first: it works with no more threads than were
 * planned for. */
void parallel_enter(void);

/* Which of parallel_width() parts of such room is the calling thread's. */
size_t parallel_slot(void);

#endif
