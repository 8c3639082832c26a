/* Exif: the two tags that say how a photograph is to be looked at. */
#ifndef SPID_FORMATS_EXIF_H
#define SPID_FORMATS_EXIF_H

#include <stddef.h>
#include <stdint.h>

#include "formats/door.h"

/* Into *t what n bytes of Exif say (from "Exif", or from the TIFF header after
 * it): the orientation, and Adobe RGB where a camera says that by a file of
 * DCF's option (index R03), which has no profile.  Nothing where they are
 * damaged. */
void exif_read(struct door_tag *t, const uint8_t *data, size_t n);

#endif
