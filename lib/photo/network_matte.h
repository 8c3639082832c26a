/* The matte of a portrait by the model's matte network, refined by the
 * picture's colours. */
#ifndef SPID_PHOTO_NETWORK_MATTE_H
#define SPID_PHOTO_NETWORK_MATTE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/net/matte_net.h"

/* matte (S,S), 255 person, of the portrait rgb (S,S,3), S at least MATTE_SIDE.
 * head (S,S) is 255 where the projected head lands, inside (S,S) 0 beyond the
 * picture's border, or NULL.  *absurd is set, and the matte left undefined,
 * where the network sees no person about the head. */
int network_matte(uint8_t *matte, bool *absurd, const uint8_t *rgb,
                  const uint8_t *head, const uint8_t *inside, size_t S,
                  struct matte_net *net, struct error *err);

#endif
