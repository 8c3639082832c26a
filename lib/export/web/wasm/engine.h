/* What the page's engine shares: model and head, and the pixels that the worker
 * hands over. */
#ifndef SPID_EXPORT_WEB_ENGINE_H
#define SPID_EXPORT_WEB_ENGINE_H

#include "formats/y4m.h"
#include "lib/head/head.h"
#include "lib/net/model.h"
#include "lib/track/encoders.h"

struct engine {
    struct model model;
    struct head head;
    struct encoders nets;
    struct error err;           /* of the last call that failed */
};

extern struct engine engine;

/* Colours [H,W,3] of the RGBA pixels that the worker last wrote, and where
 * alpha is not NULL, their alpha there (W H bytes; NULL where all are opaque);
 * both are freed by the caller.  NULL: no memory. */
uint8_t *engine_rgb(uint8_t **alpha, size_t W, size_t H);

/* The same of planes. */
uint8_t *engine_rgb_of_planes(const struct y4m *y);

/* A line about the archive that the worker is given: Module.note(key, value). */
void archive_note(const char *key, const char *value);

#endif
