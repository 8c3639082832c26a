/* Reading and writing CONF's text. */
#include "lib/stream/conf_text.h"

#include <string.h>

int conf_text_write(struct stream_writer *w, const char *json,
                    struct error *err)
{
    const struct array a = array_make("json", DTYPE_U8, json, 1, strlen(json),
                                      0, 0, 0);

    return stream_write(w, RECORD_CONF, 0, 0, &a, 1, err);
}

const char *conf_text(size_t *bytes, const struct record *rec)
{
    const struct array *a = record_find(rec, "json");

    *bytes = a && a->dtype == DTYPE_U8 ? array_bytes(a) : 0;
    return *bytes ? a->data : NULL;
}
