/* A camera's motion in the page: spid-motion's tracker. */
#include <emscripten.h>
#include <string.h>

#include "lib/export/page.h"
#include "lib/export/web/wasm/engine.h"
#include "lib/track/track.h"

static struct track track;
static bool started;            /* the portrait window is known */
static size_t width, height;    /* of the last frame */
static struct {
    double spent[4];            /* seconds: find, crop, network, head */
    double window[3];           /* the portrait's: x, y, size */
    float row[PAGE_POSE + MOTION_JAW - MOTION_EXP];
    const char *why;            /* there is no face */
} found;

/* With a cut-off in Hz at rest; 0: as E_m says it.  How many numbers a row
 * has, or -1. */
EMSCRIPTEN_KEEPALIVE
int motion_open(double smooth)
{
    static struct identity mean;        /* the landmarks' */
    const struct track_options opt = {
        .size = (double)engine.model.config.size, .smooth = smooth,
        .no_tta = true, .no_align = true
    };

    return head_fold(&mean, &engine.head, NULL, 0, &engine.err) ||
           track_init(&track, &mean, &engine.nets.motion, &opt, &engine.err)
               ? -1 : PAGE_POSE + (int)engine.head.nexp;
}

/* The portrait's window is to be found anew: another camera. */
EMSCRIPTEN_KEEPALIVE
void motion_restart(void)
{
    started = false;
}

/* The motion of the frame in engine_room: 1, motion_found has it; 0, no face;
 * -1 and engine_error. */
EMSCRIPTEN_KEEPALIVE
int motion_step(size_t W, size_t H, double time)
{
    struct track_result r = {0};
    const uint8_t *rgb = engine_rgb(NULL, W, H);
    int rc;

    if (!started || W != width || H != height) {
        width = W;
        height = H;
        rc = track_start(&track, &r, rgb, W, H, time, &engine.err);
        started = rc > 0;
        found.why = "no face is seen";
    } else {
        rc = track_step(&track, &r, rgb, W, H, time, &engine.err) ? -1
             : !r.lost;
        found.why = r.why ? r.why : found.why;
    }
    memcpy(found.spent, (double[]){r.detect_s, r.crop_s, r.network_s,
                                   r.heads_s}, sizeof found.spent);
    memcpy(found.window, &track.window, sizeof found.window);
    if (rc > 0)
        page_row(found.row, &r.motion, engine.head.nexp);
    return rc;
}

/* Where the last frame's numbers are. */
EMSCRIPTEN_KEEPALIVE
const void *motion_found(void)
{
    return &found;
}

EMSCRIPTEN_KEEPALIVE
const char *motion_why(void)
{
    return found.why;
}
