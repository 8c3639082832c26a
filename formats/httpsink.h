/* Pictures as Motion JPEG over HTTP, for any browser and for OBS: an address
 * such as http://127.0.0.1:8080 in place of a file's name. */
#ifndef SPID_FORMATS_HTTPSINK_H
#define SPID_FORMATS_HTTPSINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

struct httpsink;

/* Whether a name is an address of this kind. */
bool httpsink_is_address(const char *name);

/* Listen there.  /live.mjpg goes on as long as there are pictures, /picture.jpg
 * is the newest, / a page with them.  NULL: EX_USAGE for a bad address, and for
 * one that other machines reach unless `anyone` may look; EX_UNAVAILABLE when
 * it is taken. */
struct httpsink *httpsink_open(const char *address, bool anyone,
                               struct error *err);
/* The next picture rgb [height,width,3]; waits for nobody. */
int httpsink_write(struct httpsink *h, const uint8_t *rgb, size_t width,
                   size_t height, struct error *err);
/* No more pictures: whoever looks sees an end.  NULL is allowed. */
void httpsink_close(struct httpsink *h);

#endif
