/* Video files in by ffmpeg's libraries: frames as RGB by the matrix that the
 * file says, upright, with their times. */
#include <errno.h>
#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/parseutils.h>
#include <libswscale/swscale.h>

#include "formats/video/table.h"

#define READER_THREADS 4        /* at most; from READER_LARGE pixels on */
#define READER_LARGE (1280 * 720)

struct reader {
    struct video_reader base;
    char *path;
    bool bt601;
    AVFormatContext *file;
    AVCodecContext *codec;
    struct SwsContext *convert;
    AVPacket *packet;
    AVFrame *frame;
    AVStream *stream;
    int turns;                  /* quarters, clockwise */
    uint8_t *rows, *rgb;        /* as converted; packed and upright */
    size_t room;                /* pixels of both */
    double rate;                /* frames a second */
    double seconds;             /* that the container announces; 0: none */
    double last, pause;         /* time of the last frame; the longest time
                                 * between two */
    size_t frames;              /* announced; counted: by a table of them all,
                                 * not as an AVI counts, with empty ones */
    bool counted;
    size_t count, faults;       /* frames read; packets that no decoder takes */
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

/* MPEG-TS has no index and announces nothing, but it is made of packets of 188
 * bytes that start with 0x47 (192 with a time before each in M2TS, 204 with
 * parity behind): a file that ends inside one was cut. */
static bool reader_cut(const struct video_reader *v)
{
    static const size_t packet[3] = {188, 192, 204}, sync[3] = {0, 4, 0};
    uint8_t head[4 * 204];
    FILE *f = fopen(reader_of(v)->path, "rb");
    bool cut = false;

    if (!f)
        return false;
    if (fread(head, 1, sizeof head, f) == sizeof head &&
        fseeko(f, 0, SEEK_END) == 0) {
        const size_t size = (size_t)ftello(f);

        for (int i = 0; i < 3 && !cut; i++) {
            bool all = true;

            for (size_t at = sync[i]; at < sizeof head; at += packet[i])
                all = all && head[at] == 0x47;
            cut = all && size % packet[i] != 0;
        }
    }
    fclose(f);
    return cut;
}

static double reader_rate(const struct video_reader *v)
{
    return reader_of(v)->rate;
}

static size_t reader_frames(const struct video_reader *v)
{
    return reader_of(v)->frames;
}

/* By time, for cameras and screens are recorded at a rate that varies, and a
 * last picture may stay as long as any before it. */
static size_t reader_missing(const struct video_reader *v)
{
    const struct reader *r = reader_of(v);
    const double end = r->last + fmax(r->pause, r->rate > 0 ? 1 / r->rate : 0);
    const double mean = r->last > 0 ? (double)(r->count - 1) / r->last
                                    : r->rate;
    const double n = fmax(r->seconds - end, 0) * mean;
    const size_t lost = r->faults + (n < 1e12 ? (size_t)n : 0);
    const size_t counted = r->counted && r->frames > r->count
                         ? r->frames - r->count : 0;

    return counted > lost ? counted : lost;
}

/* How long the pictures last, as the container says; 0 where it does not.
 * Sound may go on longer than they do, so a whole file's length is theirs only
 * where they are alone in it. */
static double reader_seconds(const struct reader *r)
{
    const AVStream *s = r->stream;
    const AVDictionaryEntry *tag = av_dict_get(s->metadata, "DURATION", NULL,
                                               0);
    int64_t micros;

    if (s->duration != AV_NOPTS_VALUE)
        return (double)s->duration * av_q2d(s->time_base);
    if (tag && av_parse_time(&micros, tag->value, 1) == 0)  /* Matroska's */
        return (double)micros / AV_TIME_BASE;
    if (r->file->nb_streams == 1 && r->file->duration != AV_NOPTS_VALUE)
        return (double)r->file->duration / AV_TIME_BASE;
    return 0;
}

/* Frames a second, for how long, and how many of them. */
static void reader_announced(struct reader *r)
{
    const AVStream *s = r->stream;
    double rate = av_q2d(av_guess_frame_rate(r->file, r->stream, NULL));
    double n = (double)s->nb_frames;

    if (!(rate > 0))
        rate = av_q2d(s->avg_frame_rate);
    r->rate = rate > 0 && rate < 100000 ? rate : 0;
    r->seconds = reader_seconds(r);
    r->counted = n > 0 && strstr(r->file->iformat->name, "mp4");
    if (!(n > 0))
        n = floor(r->seconds * r->rate + 0.5);
    r->frames = n > 0 && n < 1e12 ? (size_t)n : 0;
}

/* How a telephone was held. */
static int reader_turns(const AVStream *s)
{
    const int32_t *m = (const int32_t *)(const void *)
        av_stream_get_side_data(s, AV_PKT_DATA_DISPLAYMATRIX, NULL);
    const double angle = m ? -av_display_rotation_get(m) : 0;

    return isfinite(angle) ? (int)lround(angle / 90) & 3 : 0;
}

/* The best stream and a decoder for it; a libav error number. */
static int reader_open_codec(struct reader *r)
{
    const AVCodec *codec;
    char *url = reader_url(r->path);
    int rc = url ? avformat_open_input(&r->file, url, NULL, NULL)
                 : AVERROR(ENOMEM);

    free(url);
    if (rc < 0 || (rc = avformat_find_stream_info(r->file, NULL)) < 0)
        return rc;
    rc = av_find_best_stream(r->file, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    if (rc < 0)
        return rc;
    r->stream = r->file->streams[rc];
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
        const int n = omp_get_max_threads();

        r->codec->thread_count = n < READER_THREADS ? n : READER_THREADS;
    }
    r->codec->max_pixels = (int64_t)IMAGE_MAX_PIXELS;
    return avcodec_open2(r->codec, codec, NULL);
}

/* As video_close. */
static void reader_close(struct video_reader *v)
{
    struct reader *r = reader_of(v);

    sws_freeContext(r->convert);
    av_frame_free(&r->frame);
    av_packet_free(&r->packet);
    avcodec_free_context(&r->codec);
    avformat_close_input(&r->file);
    free(r->rows);
    free(r->rgb);
    free(r->path);
    free(r);
}

/* ---- frames -------------------------------------------------------------- */

/* The next decoded frame: 1, or 0 at the end.  What cannot be decoded is
 * passed over, and counted. */
static int reader_decode(struct reader *r)
{
    for (;;) {
        int rc = avcodec_receive_frame(r->codec, r->frame);

        if (rc == 0)
            return 1;
        if (r->drained)
            return 0;
        if (rc != AVERROR(EAGAIN) && rc != AVERROR_INVALIDDATA)
            return 0;
        r->faults += rc == AVERROR_INVALIDDATA;
        do {
            av_packet_unref(r->packet);
            rc = av_read_frame(r->file, r->packet);
        } while (rc == 0 && r->packet->stream_index != r->stream->index);
        r->drained = rc < 0;
        r->faults += avcodec_send_packet(r->codec, rc < 0 ? NULL : r->packet)
                     == AVERROR_INVALIDDATA;
    }
}

/* swscale's table of the matrix that the frame says, or that players take. */
static const int *reader_matrix(const struct reader *r)
{
    const enum AVColorSpace says = r->frame->colorspace;
    int space = SWS_CS_ITU601;

    if (r->bt601)
        return sws_getCoefficients(space);
    if (says == AVCOL_SPC_BT709)
        space = SWS_CS_ITU709;
    else if (says == AVCOL_SPC_BT2020_NCL || says == AVCOL_SPC_BT2020_CL)
        space = SWS_CS_BT2020;
    else if (says == AVCOL_SPC_SMPTE240M)
        space = SWS_CS_SMPTE240M;
    else if ((says == AVCOL_SPC_UNSPECIFIED || says == AVCOL_SPC_RGB) &&
             video_is_hd(r->frame->width, r->frame->height))
        space = SWS_CS_ITU709;
    return sws_getCoefficients(space);
}

/* r->rows = the frame as RGB, `stride` bytes a row. */
static int reader_convert(struct reader *r, size_t stride, struct error *err)
{
    const AVFrame *f = r->frame;
    uint8_t *to[4] = {r->rows};
    const int line[4] = {(int)stride};
    const int full = f->color_range == AVCOL_RANGE_JPEG;
    const int *matrix = reader_matrix(r);

    r->convert = sws_getCachedContext(r->convert, f->width, f->height,
                                      (enum AVPixelFormat)f->format, f->width,
                                      f->height, AV_PIX_FMT_RGB24,
                                      SWS_BICUBIC, NULL, NULL, NULL);
    if (!r->convert)
        return error_set(err, EX_DATAERR, "%s: frame %zu: pixels of an "
                         "unknown kind", r->path, r->count);
    sws_setColorspaceDetails(r->convert, matrix, full, matrix, 1, 0, 1 << 16,
                             1 << 16);
    if (sws_scale(r->convert, (const uint8_t *const *)f->data, f->linesize, 0,
                  f->height, to, line) != f->height)
        return error_set(err, EX_DATAERR, "%s: frame %zu: cannot be turned "
                         "into RGB", r->path, r->count);
    return 0;
}

/* out (w h pixels, packed) = rows of `stride` bytes, turned by quarters. */
static void reader_turn(uint8_t *out, const uint8_t *rows, size_t stride,
                        size_t w, size_t h, int turns)
{
    for (size_t y = 0; y < h; y++) {
        const uint8_t *p = rows + y * stride;

        if (turns == 0) {
            memcpy(out + 3 * w * y, p, 3 * w);
            continue;
        }
        for (size_t x = 0; x < w; x++, p += 3) {
            const size_t to = turns == 1   ? x * h + h - 1 - y
                              : turns == 2 ? (h - 1 - y) * w + w - 1 - x
                                           : (w - 1 - x) * h + y;

            memcpy(out + 3 * to, p, 3);
        }
    }
}

/* Room for a frame, a vector's width past each row's end. */
static int reader_make_rows(struct reader *r, size_t stride, size_t h,
                            struct error *err)
{
    const size_t n = (stride * h + 64 + 2) / 3;

    if (n <= r->room)
        return 0;
    free(r->rows);
    free(r->rgb);
    r->rows = aligned_alloc(64, (3 * n + 63) / 64 * 64);
    r->rgb = malloc(3 * n);
    r->room = r->rows && r->rgb ? n : 0;
    return r->room ? 0 : error_set(err, EX_OSERR, "%s: frame %zu: out of "
                                   "memory", r->path, r->count);
}

/* Times must grow; some containers give none. */
static double reader_time(struct reader *r)
{
    const int64_t start = r->stream->start_time;
    int64_t at = r->frame->best_effort_timestamp;
    double t = NAN;

    if (at != AV_NOPTS_VALUE)
        t = (double)(at - (start == AV_NOPTS_VALUE ? 0 : start)) *
            av_q2d(r->stream->time_base);
    if (!(t > r->last) || !isfinite(t))
        t = r->last < 0 ? 0 : r->last + 1 / (r->rate > 0 ? r->rate : 25);
    if (r->last >= 0)
        r->pause = fmax(r->pause, t - r->last);
    return r->last = t;
}

/* As video_read: decoded, converted, and turned as the file asks for. */
static int reader_read(struct video_reader *v, const uint8_t **rgb,
                       size_t *width, size_t *height, double *time,
                       struct error *err)
{
    struct reader *r = reader_of(v);

    if (!reader_decode(r))
        return 0;
    const size_t w = (size_t)r->frame->width, h = (size_t)r->frame->height;
    const size_t stride = (3 * w + 63) / 64 * 64;

    if (w > IMAGE_MAX_SIDE || h > IMAGE_MAX_SIDE || w * h > IMAGE_MAX_PIXELS)
        return error_set(err, EX_DATAERR, "%s: frame %zu: %zu x %zu pixels "
                         "are too many", r->path, r->count, w, h);
    if (reader_make_rows(r, stride, h, err) || reader_convert(r, stride, err))
        return -1;
    *rgb = r->rows;
    if (r->turns || stride != 3 * w) {
        reader_turn(r->rgb, r->rows, stride, w, h, r->turns);
        *rgb = r->rgb;
    }
    *width = r->turns & 1 ? h : w;
    *height = r->turns & 1 ? w : h;
    *time = reader_time(r);
    r->count++;
    av_frame_unref(r->frame);
    return 1;
}

static const struct video_reading reader_functions = {
    reader_rate, reader_frames, reader_missing, reader_cut, reader_read,
    reader_close
};

struct video_reader *reader_open(const char *path, bool bt601,
                                 struct error *err)
{
    struct stat st;
    struct reader *r;

    av_log_set_level(AV_LOG_QUIET);     /* our messages say it instead */
    if (stat(path, &st) != 0) {
        error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                  strerror(errno));
        return NULL;
    }
    r = calloc(1, sizeof *r);
    if (r) {
        r->base.by = &reader_functions;
        r->path = strdup(path);
        r->packet = av_packet_alloc();
        r->frame = av_frame_alloc();
        r->bt601 = bt601;
        r->last = -1;
    }
    if (!r || !r->path || !r->packet || !r->frame) {
        error_set(err, EX_OSERR, "%s: out of memory", path);
    } else if (reader_open_codec(r) < 0) {
        error_set(err, EX_DATAERR, "%s: not a video or picture that can be "
                  "decoded", path);
    } else {
        reader_announced(r);
        r->turns = reader_turns(r->stream);
        return &r->base;
    }
    if (r)
        reader_close(&r->base);
    return NULL;
}
