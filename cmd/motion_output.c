/* The outputs of spid-motion (motion_output.h). */
#include "cmd/motion_output.h"

#include <stdio.h>
#include <string.h>

#include "cmd/cli.h"
#include "formats/mark.h"
#include "lib/track/take.h"

/* The picture or video that the motion is drawn upon. */
static int motion_output_overlay(struct motion_output *o, const char *path,
                                 const struct identity *id, struct error *err)
{
    mark_off();                 /* it is a recording, drawn upon */
    o->drawn = framesink_open(&(struct framesink_options){
        .path = path, .format = FRAMESINK_AUTO
    }, err);
    if (o->drawn && framesink_stream(o->drawn))
        return error_set(err, EX_USAGE, "--overlay=%s: not a name of a video "
                         "or pictures (expected .mp4, .y4m, .png with %%05d)",
                         path);
    return !o->drawn || overlay_init(&o->overlay, id, err) ? -1 : 0;
}

int motion_output_open(struct motion_output *o, const char *stream,
                       const char *take, const char *overlay,
                       const struct identity *id, struct error *err)
{
    if (take && stream && !strcmp(take, "-") && !strcmp(stream, "-"))
        return error_set(err, EX_USAGE, "--arkit=-: the stream goes there "
                         "(expected a file for one of them)");
    if (!stream && !take)
        stream = "-";
    if (stream)
        o->stream = cli_create_stream(stream);
    return overlay ? motion_output_overlay(o, overlay, id, err) : 0;
}

int motion_output_begin(struct motion_output *o, const struct conf *conf,
                        const char *take, struct error *err)
{
    if (o->stream && conf_write(o->stream, conf, err))
        return -1;
    if (take)
        o->take = livelink_create(take, (double)conf->fps_num / conf->fps_den,
                                  err);
    return take && !o->take ? -1 : 0;
}

int motion_output_write(struct motion_output *o, const struct driver_frame *f,
                        size_t nexp, struct error *err)
{
    const struct array other[2] = {motion_confidence(&f->r.confidence),
                                   motion_lost()};
    double begun = stats_begin();
    float value[LIVELINK_CHANNELS];
    int rc = 0;

    if (o->stream)
        rc = motion_write(o->stream, f->picture.index, f->picture.time,
                          &f->r.motion, nexp, other, 1 + f->r.lost, err);
    if (o->take && rc == 0) {
        take_from_motion(value, &f->r.motion, nexp);
        rc = livelink_write(o->take, f->picture.time,
                            f->r.lost ? NULL : value, err);
    }
    stats_end("encode", begun);
    return rc;
}

int motion_output_draw(struct motion_output *o, const struct frame *f,
                       const struct track_result *r,
                       const struct square *window, double size, int num,
                       int den, struct error *err)
{
    struct framesink_frame g = {.width = f->width, .height = f->height,
                                .frame = o->drawn_frames++, .time = f->time};
    double begun = stats_begin();
    char text[80];
    int rc;

    snprintf(text, sizeof text, "%llu  %.2f s%s",
             (unsigned long long)f->index, f->time,
             !r ? "  no face yet" : r->lost ? "  lost" : "");
    if (g.frame == 0)
        framesink_set_rate(o->drawn, num, den);
    g.rgb = overlay_draw(&o->overlay, f->rgb, f->width, f->height,
                         r ? &r->motion : NULL, r && r->lost, *window, size,
                         text);
    rc = g.rgb ? framesink_write(o->drawn, &g, err)
               : error_set(err, EX_OSERR, "no memory for the overlay");
    stats_end("overlay", begun);
    return rc;
}

int motion_output_close(struct motion_output *o, int rc, struct error *err)
{
    if (o->drawn && rc == 0) {
        rc = framesink_finish(o->drawn, err);
        o->drawn = NULL;
    }
    if (rc == 0 && o->stream) {
        rc = stream_finish(o->stream, err);
        o->stream = NULL;
    }
    if (rc == 0 && o->take) {
        rc = livelink_finish(o->take, err);
        o->take = NULL;
    }
    if (rc < 0) {               /* no END: the next program knows */
        if (o->drawn)           /* the frames that are there are kept */
            framesink_finish(o->drawn, NULL);
        o->drawn = NULL;
        motion_output_abandon(o);
        return -1;
    }
    overlay_release(&o->overlay);
    return 0;
}

void motion_output_abandon(struct motion_output *o)
{
    livelink_abandon(o->take);
    stream_abandon(o->stream);
    framesink_abandon(o->drawn);
    overlay_release(&o->overlay);
    memset(o, 0, sizeof *o);
}
