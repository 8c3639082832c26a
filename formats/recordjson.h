/* Records as JSON text: one object per record. */
#ifndef SPID_FORMATS_RECORDJSON_H
#define SPID_FORMATS_RECORDJSON_H

#include <stdio.h>

#include "lib/stream/stream.h"

/* One line: {"type","frame","time","arrays":[{"name","dtype","shape","min",
 * "mean","max","nonfinite"}]}; a `json` array also gives "text".  With values,
 * "data" holds every element in row-major order, so that recordjson_read makes
 * the same record again (NaN and infinities are strings). */
void recordjson_write(FILE *f, const struct record *rec, bool values);

/* Read objects of that form, one after the other or in a JSON list.  Also
 * taken: "arrays" as an object of nested lists, {"jaw": [0.1, 0, 0]}, with the
 * dtype of spid-stream(5) or else f32; a string stands for its bytes.  A
 * missing frame counts up from the last of that type; a missing time is
 * frame / fps. */
int recordjson_read(const char *path, double fps, size_t max_bytes,
                    record_sink sink, void *context, struct error *err);

#endif
