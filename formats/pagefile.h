/* A page of HTML with an archive of arrays inside: a template that holds
 * PAGEFILE_PLACE, where the archive goes as text. */
#ifndef SPID_FORMATS_PAGEFILE_H
#define SPID_FORMATS_PAGEFILE_H

#include <stddef.h>

#include "formats/safetensors.h"
#include "lib/base/error.h"

/* What the template has exactly once. */
#define PAGEFILE_PLACE "<!--AVATAR-->"
#define PAGEFILE_MAX ((size_t)64 << 20)         /* of a template, bytes */

/* Write the page beside its final name and rename it.  The archive is a
 * safetensors file (st_write), deflated (zlib) and in base64, the text of an
 * element <script type="application/x-spid" id="avatar">.  *bytes (may be
 * NULL): how large the page is.  -1 and *err when the template cannot be read
 * or has no place, or the page not be written. */
int pagefile_write(const char *path, const char *template_path,
                   const struct st_tensor *tensors, size_t count,
                   const char *const *meta, size_t *bytes,
                   struct error *err);

#endif
