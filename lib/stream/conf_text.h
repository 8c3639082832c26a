/* CONF records, the first of a stream: a text of JSON, which each program
 * writes and reads as it needs. */
#ifndef SPID_STREAM_CONF_TEXT_H
#define SPID_STREAM_CONF_TEXT_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* Write CONF with that JSON. */
int conf_text_write(struct stream_writer *w, const char *json,
                    struct error *err);
/* The JSON of a CONF record, *bytes long and not terminated; it lies in the
 * record.  NULL when there is none. */
const char *conf_text(size_t *bytes, const struct record *rec);

#endif
