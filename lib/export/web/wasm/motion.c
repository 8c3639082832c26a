/* A camera's motion in the page: spid-motion's tracker. */
#include <emscripten.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/export/page.h"
#include "lib/export/web/wasm/engine.h"
#include "lib/track/track.h"

static struct track track;
static bool started;            /* the portrait window is known */
static size_t width, height;    /* of the last frame */
static bool planes;             /* frames are planes of these colours */
static struct y4m colours;
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

/* What the frames in engine_room are from now on: planes of this kind
 * (formats/y4m.h; chroma lies as videos have it), or RGBA pixels where chroma
 * is negative. */
EMSCRIPTEN_KEEPALIVE
void motion_colours(int chroma, bool full, bool bt601)
{
    planes = chroma >= 0;
    colours = (struct y4m){.chroma = (enum y4m_chroma)(planes ? chroma : 0),
                           .site_y = 0.5, .full = full, .bt601 = bt601};
}

/* The frame's colours, left and right exchanged in a mirror; freed by the
 * caller. */
static uint8_t *motion_rgb(size_t W, size_t H, bool mirror)
{
    uint8_t *rgb;

    colours.width = W;
    colours.height = H;
    rgb = planes ? engine_rgb_of_planes(&colours) : engine_rgb(NULL, W, H);
    for (size_t y = 0; rgb && mirror && y < H; y++)
        for (size_t l = 3 * y * W, r = l + 3 * W - 3; l < r; l += 3, r -= 3) {
            uint8_t pixel[3];

            memcpy(pixel, rgb + l, 3);
            memcpy(rgb + l, rgb + r, 3);
            memcpy(rgb + r, pixel, 3);
        }
    return rgb;
}

/* The tracker's word on a frame: 1, 0, -1. */
static int motion_track(struct track_result *r, const struct frame *f)
{
    if (started && f->width == width && f->height == height) {
        const int rc = track_step(&track, r, f, &engine.err);

        found.why = r->why ? r->why : found.why;
        return rc ? -1 : !r->lost;
    }
    width = f->width;
    height = f->height;
    found.why = "no face is seen";
    const int rc = track_start(&track, r, f, NULL, &engine.err);

    started = rc > 0;
    return rc;
}

/* The motion of the frame in engine_room: 1, motion_found has it; 0, no face;
 * -1 and engine_error. */
EMSCRIPTEN_KEEPALIVE
int motion_step(size_t W, size_t H, double time, bool mirror)
{
    struct track_result r = {0};
    uint8_t *rgb = motion_rgb(W, H, mirror);
    const struct frame f = {.width = W, .height = H, .rgb = rgb,
                            .time = time};
    const int rc = rgb ? motion_track(&r, &f)
                       : error_set(&engine.err, EX_OSERR,
                                   "no memory for the frame");

    free(rgb);
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
