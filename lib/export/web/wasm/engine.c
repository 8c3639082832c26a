/* The page's engine: the tracker and Phase A themselves, compiled to
 * WebAssembly.  The worker around it (lib/export/web/engine.js) puts model and
 * head into files, calls engine_open once, and writes the pixels of every
 * picture into engine_room. */
#include "lib/export/web/wasm/engine.h"

#include <emscripten.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"

#define LARGEST 4096            /* pixels along a side: PERSON_LARGEST's window
                                 * is found in twice as many */

struct engine engine;
static uint8_t *pixels;         /* RGBA, then in their place RGB */
static size_t room;

/* What went wrong, in words. */
EMSCRIPTEN_KEEPALIVE
const char *engine_error(void)
{
    return engine.err.text;
}

/* Model and head, from /model and /head: 0, or -1 and engine_error. */
EMSCRIPTEN_KEEPALIVE
int engine_open(void)
{
    parallel_set_width(1);
    return model_open(&engine.model, "/model", &engine.err) ||
           head_load(&engine.head, "/head", &engine.err) ||
           encoders_open(&engine.nets, &engine.model, true, NN_FAST,
                         &engine.err) ? -1 : 0;
}

/* Room for the pixels of the next picture: 4 W H bytes, RGBA; NULL: too large
 * for this page. */
EMSCRIPTEN_KEEPALIVE
uint8_t *engine_room(size_t W, size_t H)
{
    if (W > LARGEST || H > LARGEST)
        return NULL;
    if (4 * W * H > room) {
        free(pixels);
        pixels = malloc(4 * W * H);
        room = pixels ? 4 * W * H : 0;
    }
    return pixels;
}

uint8_t *engine_rgb(uint8_t **alpha, size_t W, size_t H)
{
    const uint8_t *from = pixels;
    uint8_t *to = pixels, all = 255;

    if (alpha && !(*alpha = malloc(W * H)))
        return NULL;
    for (size_t i = 0; i < W * H; i++, from += 4, to += 3) {
        if (alpha)
            all &= (*alpha)[i] = from[3];
        memmove(to, from, 3);
    }
    if (alpha && all == 255) {
        free(*alpha);
        *alpha = NULL;
    }
    return pixels;
}
