/* The page's engine: the tracker and Phase A themselves, compiled to
 * WebAssembly.  The worker around it (lib/export/web/engine.js) puts model and
 * head into files, calls engine_open once, and writes the pixels of every
 * picture into engine_room. */
#include "lib/export/web/wasm/engine.h"

#include <emscripten.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/parallel.h"

#define SIDE_MAX 4096           /* pixels along a side: PERSON_MAX's window
                                 * is found in twice as many */

struct engine engine;
static uint8_t *given;          /* the next picture, as the worker writes it */

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
    static struct nn_pool maps;         /* networks run one after another */

    parallel_set_width(1);
    nn_pool_use(&maps);
    return model_open(&engine.model, "/model", &engine.err) ||
           head_load(&engine.head, "/head", &engine.err) ||
           encoders_open(&engine.nets, &engine.model, true, NN_FAST,
                         &engine.err) ? -1 : 0;
}

/* The room is free again: its picture is in rgb. */
static uint8_t *engine_taken(uint8_t *rgb)
{
    free(given);
    given = NULL;
    return rgb;
}

/* Room for the next picture, RGBA or planes as decoders give them: 4 W H bytes;
 * NULL: too large for this page. */
EMSCRIPTEN_KEEPALIVE
uint8_t *engine_room(size_t W, size_t H)
{
    free(given);
    given = W > SIDE_MAX || H > SIDE_MAX ? NULL : malloc(4 * W * H);
    return given;
}

uint8_t *engine_rgb(uint8_t **alpha, size_t W, size_t H)
{
    uint8_t *rgb = malloc(3 * W * H), *to = rgb, all = 255;

    if (alpha && !(*alpha = malloc(W * H))) {
        free(rgb);
        return NULL;
    }
    for (size_t i = 0; rgb && i < W * H; i++, to += 3) {
        if (alpha)
            all &= (*alpha)[i] = given[4 * i + 3];
        memcpy(to, given + 4 * i, 3);
    }
    if (alpha && all == 255) {
        free(*alpha);
        *alpha = NULL;
    }
    return engine_taken(rgb);
}

uint8_t *engine_rgb_of_planes(const struct y4m *y)
{
    uint8_t *rgb = malloc(3 * y->width * y->height);

    if (rgb)
        y4m_to_rgb(rgb, given, y);
    return engine_taken(rgb);
}
