/* Video files in by ffmpeg's libraries: frames whole, as RGB by what the file
 * says of them, through the door (formats/door.h), with their times. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <time.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/cpu.h>
#include <libavutil/display.h>
#include <libavutil/mastering_display_metadata.h>

#include "formats/door.h"
#include "formats/video/table.h"

#define READER_THREADS 4        /* at most; from READER_LARGE pixels on */
#define READER_LARGE (1280 * 720)
#define READER_PATIENCE 10      /* seconds that an address may send nothing */

struct reader {
    struct video_reader base;
    char *path;
    bool live;                  /* an address */
    time_t since;               /* when a packet was asked for */
    AVFormatContext *file;
    AVCodecContext *codec;
    struct video_colours colours;
    AVPacket *packet;
    AVFrame *frame;
    AVFrame *next;              /* the first of another size, while the filter
                                 * gives the last of the one before */
    AVStream *stream;
    struct video_crop crop;     /* the container's */
    struct filter *weave;       /* fields to frames, once any are met */
    bool woven;                 /* there is none that could */
    struct door door;
    struct image upright;
    uint8_t *rows;              /* as converted */
    size_t room;                /* bytes of them */
    double last;                /* time of the last frame */
    size_t count, faults;       /* frames read; packets that no decoder takes */
    bool broken;                /* the last packet is not whole */
    bool drained;               /* no packet is left */
};

static struct reader *reader_of(const struct video_reader *v)
{
    return (struct reader *)(uintptr_t)v;
}

char *reader_url(const char *path)
{
    const size_t size = sizeof "file:" + strlen(path);
    char *url = malloc(size);

    if (url)
        snprintf(url, size, "file:%s", path);
    return url;
}

/* ---- the container ------------------------------------------------------- */

/* After the last frame the container knows better how long it stays. */
static void reader_end(struct reader *r)
{
    const AVStream *s = r->stream;
    double end = 0;

    if (r->file->nb_streams == 1 && r->file->duration != AV_NOPTS_VALUE &&
        r->file->start_time != AV_NOPTS_VALUE)
        end = (double)(r->file->start_time + r->file->duration) /
              AV_TIME_BASE;
    else if (s->duration != AV_NOPTS_VALUE && s->start_time != AV_NOPTS_VALUE)
        end = (double)(s->start_time + s->duration) * av_q2d(s->time_base);
    if (end > r->last)
        r->base.end = end;
}

/* How many samples an index of all of them shows: those that an edit list
 * leaves. */
static double reader_shown(const AVStream *s)
{
    const int n = avformat_index_get_entries_count(s);
    double shown = 0;

    for (int i = 0; i < n; i++)
        shown += !(avformat_index_get_entry((AVStream *)s, i)->flags &
                   AVINDEX_DISCARD_FRAME);
    return shown;
}

/* Frames a second, how many of them, and whether there is sound. */
static void reader_announced(struct reader *r)
{
    const AVStream *s = r->stream;
    double rate = av_q2d(av_guess_frame_rate(r->file, r->stream, NULL));
    double n = (double)s->nb_frames;

    if (!(rate > 0))
        rate = av_q2d(s->avg_frame_rate);
    r->base.rate = rate = rate > 0 && rate < 100000 ? rate : 0;
    if (r->live)
        return;
    r->base.sounds = av_find_best_stream(r->file, AVMEDIA_TYPE_AUDIO, -1, -1,
                                         NULL, 0) >= 0;
    if (n > 0 && strstr(r->file->iformat->name, "mp4"))
        n = reader_shown(s);
    if (!(n > 0) && s->duration != AV_NOPTS_VALUE)
        n = floor((double)s->duration * av_q2d(s->time_base) * rate + 0.5);
    if (!(n > 0) && r->file->duration != AV_NOPTS_VALUE)
        n = floor((double)r->file->duration / AV_TIME_BASE * rate + 0.5);
    r->base.frames = n > 0 && n < 1e12 ? (size_t)n : 0;
}

/* libav's AVIOInterruptCB: whether to wait no longer. */
static int reader_is_late(void *reader)
{
    return time(NULL) - ((struct reader *)reader)->since > READER_PATIENCE;
}

/* The container; a libav error number. */
static int reader_open_container(struct reader *r)
{
    char *url = r->live ? strdup(r->path) : reader_url(r->path);
    int rc = url && (r->file = avformat_alloc_context()) ? 0 : AVERROR(ENOMEM);

    if (rc == 0 && r->live) {
        r->since = time(NULL);
        r->file->interrupt_callback =
            (AVIOInterruptCB){reader_is_late, r};
    }
    if (rc == 0)
        rc = avformat_open_input(&r->file, url, NULL, NULL);
    free(url);
    return rc < 0 ? rc : avformat_find_stream_info(r->file, NULL);
}

/* The best stream and a decoder for it; a libav error number. */
static int reader_open_codec(struct reader *r)
{
    const AVCodec *codec;
    int rc = reader_open_container(r);

    if (rc < 0)
        return rc;
    rc = av_find_best_stream(r->file, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    if (rc < 0)
        return rc;
    r->stream = r->file->streams[rc];
    if (r->stream->disposition & AV_DISPOSITION_ATTACHED_PIC)
        return AVERROR_STREAM_NOT_FOUND;        /* sound, and its cover */
    for (unsigned i = 0; i < r->file->nb_streams; i++)
        if ((int)i != rc)
            r->file->streams[i]->discard = AVDISCARD_ALL;
    r->codec = avcodec_alloc_context3(codec);
    if (!r->codec)
        return AVERROR(ENOMEM);
    rc = avcodec_parameters_to_context(r->codec, r->stream->codecpar);
    if (rc < 0)
        return rc;
    if (r->codec->width * (int64_t)r->codec->height > READER_LARGE) {
        const int n = av_cpu_count();

        r->codec->thread_count = n < READER_THREADS ? n : READER_THREADS;
    }
    r->codec->max_pixels = (int64_t)IMAGE_MAX_PIXELS;
    r->codec->flags |= AV_CODEC_FLAG_UNALIGNED;     /* crop to the pixel */
    return avcodec_open2(r->codec, codec, NULL);
}

/* As video_close. */
static void reader_close(struct video_reader *v)
{
    struct reader *r = reader_of(v);

    if (r->weave)
        module_filter()->close(r->weave);
    door_release(&r->door);
    free(r->upright.rgb);
    video_colours_release(&r->colours);
    av_frame_free(&r->frame);
    av_frame_free(&r->next);
    av_packet_free(&r->packet);
    avcodec_free_context(&r->codec);
    avformat_close_input(&r->file);
    free(r->rows);
    free(r->path);
    free(r);
}

/* ---- frames -------------------------------------------------------------- */

/* The next packet to the decoder, or that there is none.  What cannot be
 * decoded is passed over, and counted from the first picture on: a clip that
 * was cut out of another may begin with what leans on frames before it. */
static void reader_feed(struct reader *r)
{
    int rc;

    do {
        av_packet_unref(r->packet);
        r->since = time(NULL);
        rc = av_read_frame(r->file, r->packet);
    } while (rc == 0 && r->packet->stream_index != r->stream->index);
    r->drained = rc < 0;
    if (rc < 0)
        r->broken |= rc != AVERROR_EOF;
    else
        r->broken = r->packet->flags & AV_PKT_FLAG_CORRUPT;
    rc = avcodec_send_packet(r->codec, rc < 0 ? NULL : r->packet);
    r->faults += rc == AVERROR_INVALIDDATA && r->count;
}

/* The next decoded frame: 1, or 0 at the end. */
static int reader_decode(struct reader *r)
{
    for (;;) {
        const int rc = avcodec_receive_frame(r->codec, r->frame);

        if (rc == 0)
            return 1;
        if (r->drained || (rc != AVERROR(EAGAIN) && rc != AVERROR_INVALIDDATA))
            return 0;
        r->faults += rc == AVERROR_INVALIDDATA && r->count;
        reader_feed(r);
    }
}

/* From the first frame of two fields on all frames pass a filter, which leaves
 * whole ones as they are. */
static void reader_start_weaving(struct reader *r)
{
    const struct filter_module *m = module_filter();
    const AVRational step = r->stream->time_base;

    r->woven = true;            /* tried */
    if (m)
        r->weave = m->open("bwdif=mode=send_frame:parity=auto:deint=interlaced",
                           r->frame, step.num, step.den);
}

/* The frame into the filter, or with rc 0 the end; so, too, where frames of
 * another size begin, the first of which waits.  0, or a libav error number. */
static int reader_weave(struct reader *r, const struct filter_module *m, int rc)
{
    if (rc == 0)
        return m->send(r->weave, NULL);
    r->frame->pts = r->frame->best_effort_timestamp;
    rc = m->send(r->weave, r->frame);
    if (rc != AVERROR_INPUT_CHANGED)
        return rc;
    av_frame_move_ref(r->next, r->frame);
    return m->send(r->weave, NULL);
}

/* The next frame out of the filter, as reader_next. */
static int reader_woven(struct reader *r)
{
    const struct filter_module *m = module_filter();

    for (;;) {
        const int got = m->receive(r->weave, r->frame);
        int rc;

        if (got >= 0) {
            r->frame->best_effort_timestamp = r->frame->pts;
            return 1;
        }
        if (got == AVERROR(EAGAIN)) {
            rc = reader_decode(r);
        } else if (r->next->buf[0]) {
            m->close(r->weave);
            av_frame_move_ref(r->frame, r->next);
            reader_start_weaving(r);
            if (!r->weave)
                return 1;
            rc = 1;
        } else {
            return 0;
        }
        if (reader_weave(r, m, rc) < 0)
            return 0;
        av_frame_unref(r->frame);
    }
}

/* The next whole frame: 1, or 0 at the end. */
static int reader_next(struct reader *r)
{
    if (r->weave)
        return reader_woven(r);
    const int rc = reader_decode(r);

    if (rc == 1 && r->frame->interlaced_frame && !r->woven)
        reader_start_weaving(r);
    if (!r->weave)
        return rc;
    if (reader_weave(r, module_filter(), rc) < 0)
        return 0;
    av_frame_unref(r->frame);
    return reader_woven(r);
}

/* How a camera or telephone was held, by the nearest of the eight ways. */
static enum orientation reader_orientation(const struct reader *r)
{
    const AVFrameSideData *own = av_frame_get_side_data(
        r->frame, AV_FRAME_DATA_DISPLAYMATRIX);
    const void *data = own ? own->data : av_stream_get_side_data(
        r->stream, AV_PKT_DATA_DISPLAYMATRIX, NULL);
    const int32_t *m = data;

    if (!m)
        return ORIENT_UPRIGHT;
    const double a = m[0], b = m[1], c = m[3], d = m[4];

    if (fabs(a) + fabs(d) >= fabs(b) + fabs(c))         /* x' = a x, y' = d y */
        return a >= 0 ? d >= 0 ? ORIENT_UPRIGHT : ORIENT_FLIPPED
                      : d >= 0 ? ORIENT_MIRRORED : ORIENT_HALF_TURN;
    return b >= 0 ? c >= 0 ? ORIENT_TRANSPOSED : ORIENT_TURN_RIGHT
                  : c >= 0 ? ORIENT_TURN_LEFT : ORIENT_TRANSVERSED;
}

/* cd/m2 of the brightest pixel, as the file says; 0: it does not. */
static double reader_peak(const AVFrame *f)
{
    const AVFrameSideData *level = av_frame_get_side_data(
        f, AV_FRAME_DATA_CONTENT_LIGHT_LEVEL);
    const AVFrameSideData *master = av_frame_get_side_data(
        f, AV_FRAME_DATA_MASTERING_DISPLAY_METADATA);
    const AVContentLightMetadata *l = level ? (const void *)level->data : NULL;
    const AVMasteringDisplayMetadata *d = master ? (const void *)master->data
                                                 : NULL;

    if (l && l->MaxCLL)
        return l->MaxCLL;
    return d && d->has_luminance ? av_q2d(d->max_luminance) : 0;
}

/* What the door is to do with the frame.  Its colours are a display's, so the
 * curve of SDR is that of sRGB; of their code points only those count that
 * make another gamut or range of it. */
static struct door_tag reader_tag(const struct reader *r)
{
    const AVFrame *f = r->frame;
    const AVRational sar = av_guess_sample_aspect_ratio(
        r->file, r->stream, r->frame);
    const bool hdr = f->color_trc == AVCOL_TRC_SMPTE2084 ||
                     f->color_trc == AVCOL_TRC_ARIB_STD_B67;
    const bool wide = f->color_primaries == AVCOL_PRI_BT2020 ||
                      f->color_primaries == AVCOL_PRI_SMPTE431 ||
                      f->color_primaries == AVCOL_PRI_SMPTE432;
    struct door_tag t = {
        .orientation = reader_orientation(r),
        .aspect = sar.num > 0 && sar.den > 0 ? av_q2d(sar) : 1,
        .pixels = {.channels = 3, .bits = hdr || wide ? 16 : 8}
    };

    if (hdr || wide)
        t.colour.primaries = (int)f->color_primaries;
    if (hdr) {
        t.colour.transfer = (int)f->color_trc;
        t.colour.peak = reader_peak(f);
    }
    return t;
}

/* Room for a frame, a vector's width past each row's end. */
static int reader_make_rows(struct reader *r, size_t bytes, struct error *err)
{
    if (bytes <= r->room)
        return 0;
    free(r->rows);
    r->room = (bytes + 63) / 64 * 64;
    r->rows = aligned_alloc(64, r->room);
    if (r->rows)
        return 0;
    r->room = 0;
    return error_set(err, EX_OSERR, "%s: frame %zu: out of memory", r->path,
                     r->count);
}

/* Seconds of the container; times must grow, and some containers give none. */
static double reader_time(struct reader *r)
{
    const AVFrame *f = r->frame;
    const double step = av_q2d(r->stream->time_base);
    const double pause = 1 / (r->base.rate > 0 ? r->base.rate : 25);
    const int64_t at = f->best_effort_timestamp;
    double t = at != AV_NOPTS_VALUE ? (double)at * step : NAN;

    if (!isfinite(t) || (r->count && !(t > r->last)))
        t = r->count ? r->last + pause : 0;
    r->base.end = t + (f->pkt_duration > 0 ? (double)f->pkt_duration * step
                                           : pause);
    return r->last = t;
}

/* Whether the end is where it should be: 0, or -1. */
static int reader_finish(struct reader *r, struct error *err)
{
    if (r->drained)
        reader_end(r);
    if (r->count == 0)
        return error_set(err, EX_DATAERR, "%s: no frame could be decoded",
                         r->path);
    if (r->live)
        return 0;               /* it has no end that could be missing */
    if (r->faults > 2 + r->count / 100)
        return error_set(err, EX_DATAERR, "%s: frame %zu: damaged: %zu frames "
                         "cannot be decoded", r->path, r->count, r->faults);
    if (r->broken || video_is_cut(r->file, r->stream))
        return error_set(err, EX_DATAERR, "%s: frame %zu: cut short (the file "
                         "ends before what it says it holds)", r->path,
                         r->count);
    return 0;
}

/* The frame as it is, where nothing is to be done, or through the door;
 * without what the container's rectangle leaves out. */
static int reader_pass(struct reader *r, const uint8_t **rgb, size_t *width,
                       size_t *height, struct error *err)
{
    const struct video_crop *c = &r->crop;
    size_t w = (size_t)r->frame->width, h = (size_t)r->frame->height;
    const struct door_tag tag = reader_tag(r);
    const size_t pixel = 3 * (size_t)tag.pixels.bits / 8;
    const size_t stride = (pixel * w + 63) / 64 * 64;
    const uint8_t *first;
    const char *why;

    if (door_check_size(w, h, r->path, err) ||
        reader_make_rows(r, stride * h + 64, err))
        return -1;
    if ((why = video_to_rgb(r->rows, stride, tag.pixels.bits, r->frame,
                            &r->colours)))
        return error_set(err, EX_DATAERR, "%s: frame %zu: %s", r->path,
                         r->count, why);
    first = r->rows;
    if (c->left + c->right < w && c->top + c->bottom < h) {
        first += c->top * stride + c->left * pixel;
        w -= c->left + c->right;
        h -= c->top + c->bottom;
    }
    *rgb = first;
    *width = w;
    *height = h;
    if (tag.orientation == ORIENT_UPRIGHT && tag.pixels.bits == 8 &&
        tag.aspect == 1 && stride == 3 * w)
        return 0;
    if (door_picture(&r->door, &r->upright, w, h, &tag, first, stride, r->path,
                     err))
        return -1;
    *rgb = r->upright.rgb;
    *width = r->upright.width;
    *height = r->upright.height;
    return 0;
}

/* As video_read. */
static int reader_read(struct video_reader *v, const uint8_t **rgb,
                       size_t *width, size_t *height, double *time,
                       struct error *err)
{
    struct reader *r = reader_of(v);

    if (!reader_next(r))
        return reader_finish(r, err);
    if (reader_pass(r, rgb, width, height, err))
        return -1;
    *time = reader_time(r);
    r->count++;
    av_frame_unref(r->frame);
    return 1;
}

static const struct video_reading reader_functions = {
    reader_read, reader_close
};

struct video_reader *reader_open(const char *path, bool bt601,
                                 y4m_rows_fn *to_rgb, struct error *err)
{
    const bool live = video_is_live(path);
    struct stat st;
    struct reader *r;
    int rc = 0;

    av_log_set_level(AV_LOG_QUIET);     /* our messages say it instead */
    if (live)
        avformat_network_init();
    else if (stat(path, &st) != 0) {
        return error_null(err, EX_NOINPUT, "%s: cannot open: %s", path,
                          strerror(errno));
    }
    r = calloc(1, sizeof *r);
    if (r) {
        r->base.by = &reader_functions;
        r->path = strdup(path);
        r->packet = av_packet_alloc();
        r->frame = av_frame_alloc();
        r->next = av_frame_alloc();
        r->colours = (struct video_colours){.bt601 = bt601,
                                            .to_rgb = to_rgb};
        r->live = live;
    }
    if (!r || !r->path || !r->packet || !r->frame || !r->next) {
        error_set(err, EX_OSERR, "%s: out of memory", path);
    } else if ((rc = reader_open_codec(r)) < 0 && live) {
        char why[AV_ERROR_MAX_STRING_SIZE];

        error_set(err, EX_NOINPUT, "%s: no video comes from there: %s", path,
                  rc == AVERROR_EXIT ? "nothing was sent"
                  : av_strerror(rc, why, sizeof why) < 0 ? "unknown" : why);
    } else if (rc < 0) {
        error_set(err, EX_DATAERR, "%s: not a video or picture that can be "
                  "decoded", path);
    } else {
        reader_announced(r);
        r->crop = video_find_crop(r->file, r->stream);
        return &r->base;
    }
    if (r)
        reader_close(&r->base);
    return NULL;
}
