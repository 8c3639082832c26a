/* A camera's motion in the page: spid-motion's tracker, and what it has done since
 * its neutral frame, done from where the source is. */
#include <emscripten.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/export/page.h"
#include "lib/export/web/wasm/engine.h"
#include "lib/track/relative.h"
#include "lib/track/track.h"

#define ROW (PAGE_POSE + MOTION_JAW - MOTION_EXP)

static struct track track;
static bool started;            /* the portrait window is known */
static size_t width, height;    /* of the last frame */
static bool planes;             /* frames are planes of these colours */
static struct y4m colours;
static struct {
    double spent[4];            /* seconds: find, crop, network, head */
    double window[3];           /* the portrait's: x, y, size */
    float row[ROW], driven[ROW];        /* as it is, and relative */
    const char *why;            /* there is no face */
} found;
static struct motion last, neutral;
static float source[ROW];       /* the page's person, the face at rest */
static bool has_source, rested; /* it was said; neutral is known */

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
    started = rested = false;
}

/* Where the row of the person who is driven goes. */
EMSCRIPTEN_KEEPALIVE
float *motion_source(void)
{
    has_source = true;
    return source;
}

/* The last frame's face is the driver's at rest. */
EMSCRIPTEN_KEEPALIVE
void motion_rest(void)
{
    neutral = last;
    calm_face(&neutral, &track.calm);
    rested = true;
}

/* What was found, as it is and as the page's person does it. */
static void motion_say(const struct motion *m)
{
    const size_t nexp = engine.head.nexp;
    struct motion from, driven = *m;
    struct relative relative;

    last = *m;
    if (!rested)
        motion_rest();
    page_motion(&from, source, nexp);
    relative_init(&relative, &from, &neutral, nexp);
    if (has_source)
        relative_apply(&driven, &relative);
    page_row(found.row, m, nexp);
    page_row(found.driven, &driven, nexp);
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
        motion_say(&r.motion);
    return rc;
}

/* Where the last frame's numbers are. */
EMSCRIPTEN_KEEPALIVE
const void *motion_found(void)
{
    return &found;
}

EMSCRIPTEN_KEEPALIVE
const float *motion_driven(void)
{
    return found.driven;
}

EMSCRIPTEN_KEEPALIVE
const char *motion_why(void)
{
    return found.why;
}
