/* Writing takes of Live Link Face (livelink.h): channel names, timecodes,
 * rows. */
#include "formats/livelink.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/outfile.h"

/* The app's order. */
static const char *const channels[LIVELINK_CHANNELS] = {
    "EyeBlinkLeft", "EyeLookDownLeft", "EyeLookInLeft", "EyeLookOutLeft",
    "EyeLookUpLeft", "EyeSquintLeft", "EyeWideLeft", "EyeBlinkRight",
    "EyeLookDownRight", "EyeLookInRight", "EyeLookOutRight",
    "EyeLookUpRight", "EyeSquintRight", "EyeWideRight", "JawForward",
    "JawRight", "JawLeft", "JawOpen", "MouthClose", "MouthFunnel",
    "MouthPucker", "MouthRight", "MouthLeft", "MouthSmileLeft",
    "MouthSmileRight", "MouthFrownLeft", "MouthFrownRight",
    "MouthDimpleLeft", "MouthDimpleRight", "MouthStretchLeft",
    "MouthStretchRight", "MouthRollLower", "MouthRollUpper",
    "MouthShrugLower", "MouthShrugUpper", "MouthPressLeft",
    "MouthPressRight", "MouthLowerDownLeft", "MouthLowerDownRight",
    "MouthUpperUpLeft", "MouthUpperUpRight", "BrowDownLeft",
    "BrowDownRight", "BrowInnerUp", "BrowOuterUpLeft", "BrowOuterUpRight",
    "CheekPuff", "CheekSquintLeft", "CheekSquintRight", "NoseSneerLeft",
    "NoseSneerRight", "TongueOut", "HeadYaw", "HeadPitch", "HeadRoll",
    "LeftEyeYaw", "LeftEyePitch", "LeftEyeRoll", "RightEyeYaw",
    "RightEyePitch", "RightEyeRoll"
};

struct livelink_writer {
    struct outfile out;
    long rate;                  /* frames of a second */
};

const char *livelink_channel(int k)
{
    return channels[k];
}

/* What has been written leaves the program now: someone may be reading along.
 * 0, or -1 and *err. */
static int livelink_writer_flush(struct livelink_writer *w, struct error *err)
{
    return fflush(w->out.file) || ferror(w->out.file)
               ? outfile_error(&w->out, err) : 0;
}

struct livelink_writer *livelink_create(const char *path, double rate,
                                        struct error *err)
{
    struct livelink_writer *w = calloc(1, sizeof *w);

    if (!w)
        return error_null(err, EX_OSERR, "%s: no memory", path);
    w->rate = lround(ceil(rate - 0.02));
    if (w->rate < 1)
        w->rate = 1;
    if (outfile_open(&w->out, path, err)) {
        free(w);
        return NULL;
    }
    fputs("Timecode,BlendShapeCount", w->out.file);
    for (int k = 0; k < LIVELINK_CHANNELS; k++)
        fprintf(w->out.file, ",%s", channels[k]);
    fputc('\n', w->out.file);
    if (livelink_writer_flush(w, err)) {
        livelink_abandon(w);
        return NULL;
    }
    return w;
}

int livelink_write(struct livelink_writer *w, double time, const float *value,
                   struct error *err)
{
    long long second = (long long)floor(time);
    long long parts = llround((time - (double)second) * 1e3 *
                              (double)w->rate);     /* of a frame, 1/1000 */

    second += parts / (1000 * w->rate);
    parts %= 1000 * w->rate;
    fprintf(w->out.file, "%02lld:%02lld:%02lld:%02lld.%03lld,%d",
            second / 3600 % 24, second / 60 % 60, second % 60, parts / 1000,
            parts % 1000, value ? LIVELINK_CHANNELS : 0);
    for (int k = 0; value && k < LIVELINK_CHANNELS; k++)
        fprintf(w->out.file, ",%.10f", (double)value[k]);
    fputc('\n', w->out.file);
    return livelink_writer_flush(w, err);
}

int livelink_finish(struct livelink_writer *w, struct error *err)
{
    int rc = outfile_close(&w->out, err);

    free(w);
    return rc;
}

void livelink_abandon(struct livelink_writer *w)
{
    if (w)
        outfile_abandon(&w->out);
    free(w);
}
