/* A person who is cut by the photograph's edges, continued beyond them, for a
 * portrait window that reaches past the picture. */
#ifndef SPID_PHOTO_BEYOND_H
#define SPID_PHOTO_BEYOND_H

#include <stdint.h>

#include "lib/head/person.h"

/* Where inside [size,size] is 0: p's matte and rgb, from what the picture's
 * edges show of the person and from p->back.  A body goes on below and widens,
 * shoulders fall to the sides, a head that is cut gets a dome, which above
 * turns into the colours of the head's sides: hair, where there is any.  The
 * picture is one rectangle of the window; its own pixels are left alone. */
void beyond_continue(struct person *p, const uint8_t *inside);

#endif
