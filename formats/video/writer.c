/* Video files out by ffmpeg's libraries: the codec that its name asks for, or
 * the next best that is there, with the sound of another clip; animations of
 * GIF, WebP and APNG. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>

#include "formats/video/table.h"
#include "lib/base/file.h"

/* A codec as it is used, and how; ended by no codec. */
struct writer_codec {
    enum AVCodecID id;
    enum AVPixelFormat pixels;
    const char *name;           /* of the encoder, or NULL: the first */
    const char *options;        /* key=value:... of the encoder */
    int step;                   /* times in so many parts of a second, of
                                 * frames of RGB; 0: in steps of the rate */
};

/* What a file of an ending is, the best first. */
struct writer_kind {
    const char *ending;
    enum { OPAQUE, ALPHA, EITHER } alpha;
    const char *format;         /* muxer, or NULL: by the ending */
    const char *muxer;          /* its options */
    struct writer_codec codec[3];
};

#define CRF "preset=veryfast:crf=20"
#define PALETTE "split[a][b];[a]palettegen=stats_mode=single[p];" \
                "[b][p]paletteuse=new=1:dither=sierra2_4a"

static const struct writer_kind kinds[] = {
    {".webm", ALPHA, NULL, NULL,
     {{AV_CODEC_ID_VP9, AV_PIX_FMT_YUVA420P, "libvpx-vp9", "auto-alt-ref=0",
       0}}},
    {".mkv", ALPHA, NULL, NULL,
     {{AV_CODEC_ID_VP9, AV_PIX_FMT_YUVA420P, "libvpx-vp9", "auto-alt-ref=0",
       0}}},
    {".mov", ALPHA, NULL, NULL,
     {{AV_CODEC_ID_PRORES, AV_PIX_FMT_YUVA444P10, "prores_ks",
       "profile=4444", 0}}},
    {".webm", OPAQUE, NULL, NULL,
     {{AV_CODEC_ID_VP9, AV_PIX_FMT_YUV420P, NULL, NULL, 0},
      {AV_CODEC_ID_VP8, AV_PIX_FMT_YUV420P, NULL, NULL, 0}}},
    {".gif", EITHER, "gif", "loop=0",
     {{AV_CODEC_ID_GIF, AV_PIX_FMT_PAL8, NULL, NULL, 100}}},
    {".webp", EITHER, "webp", "loop=0",
     {{AV_CODEC_ID_WEBP, AV_PIX_FMT_BGRA, "libwebp_anim", "quality=85", 1000}}},
    /* .apng, and .png */
    {"png", ALPHA, "apng", "plays=0",
     {{AV_CODEC_ID_APNG, AV_PIX_FMT_RGBA, NULL, "pred=mixed", 1000}}},
    {"png", OPAQUE, "apng", "plays=0",
     {{AV_CODEC_ID_APNG, AV_PIX_FMT_RGB24, NULL, "pred=mixed", 1000}}},
    {"", EITHER, NULL, NULL,
     {{AV_CODEC_ID_H264, AV_PIX_FMT_YUV420P, NULL, CRF, 0},
      {AV_CODEC_ID_MPEG4, AV_PIX_FMT_YUV420P, NULL, NULL, 0}}}
};

struct video_writer {
    char *path;
    const struct writer_kind *kind;
    struct video_options opt;
    size_t count;
    double first;               /* time of the first frame */
    int64_t next;               /* the earliest step of the next */
    double lead;                /* seconds of the file before the first */
    AVFormatContext *file;
    AVCodecContext *codec;
    struct SwsContext *convert;
    AVStream *stream;
    AVPacket *packet;
    AVFrame *frame;             /* the last one, until its duration is known */
    AVFrame *plain;             /* as it came, for the palette's filter */
    struct filter *palette;
    struct sound *sound;
    uint8_t *even;              /* pixels of even sides, where they are odd */
};

/* What libav says, with our path before it. */
static int writer_fault(const struct video_writer *v, int code, int number,
                        struct error *err)
{
    char why[AV_ERROR_MAX_STRING_SIZE];

    av_strerror(number, why, sizeof why);
    return error_set(err, code, "%s: frame %zu: %s", v->path, v->count, why);
}

static void writer_abandon(struct video_writer *v)
{
    if (v->palette)
        module_filter()->close(v->palette);
    sound_close(v->sound);
    if (v->file && v->file->pb)
        avio_closep(&v->file->pb);
    sws_freeContext(v->convert);
    av_frame_free(&v->frame);
    av_frame_free(&v->plain);
    av_packet_free(&v->packet);
    avcodec_free_context(&v->codec);
    avformat_free_context(v->file);
    free(v->even);
    free(v->path);
    free(v);
}

/* ---- opening ------------------------------------------------------------- */

/* How frames lie: as they come. */
static enum AVPixelFormat writer_plain(const struct video_writer *v)
{
    return v->opt.alpha ? AV_PIX_FMT_RGBA : AV_PIX_FMT_RGB24;
}

/* An encoder as it will be used; a libav error number. */
static int writer_try(struct video_writer *v, const struct writer_codec *w)
{
    const AVCodec *codec = w->name ? avcodec_find_encoder_by_name(w->name)
                                   : avcodec_find_encoder(w->id);
    const AVRational rate = av_d2q(v->opt.rate, 100000);
    AVCodecContext *c = codec ? avcodec_alloc_context3(codec) : NULL;
    AVDictionary *options = NULL;
    int rc;

    if (!c)
        return AVERROR_ENCODER_NOT_FOUND;
    const bool even = w->step == 0;     /* YUV */

    c->width = (int)(v->opt.width + (even && v->opt.width % 2));
    c->height = (int)(v->opt.height + (even && v->opt.height % 2));
    c->pix_fmt = w->pixels;
    c->time_base = w->step ? (AVRational){1, w->step} : av_inv_q(rate);
    c->framerate = rate;
    c->thread_count = 1;        /* the same bytes on any machine */
    if (even) {
        c->color_range = AVCOL_RANGE_MPEG;
        c->colorspace = video_is_hd(c->width, c->height)
                      ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
    }
    c->flags |= AV_CODEC_FLAG_BITEXACT;
    if (v->file->oformat->flags & AVFMT_GLOBALHEADER)
        c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    if (!w->options || w->id == AV_CODEC_ID_VP9)
        c->bit_rate = (int64_t)(4 * v->opt.rate * c->width * c->height);
    rc = av_dict_parse_string(&options, w->options, "=", ":", 0);
    if (rc >= 0)
        rc = avcodec_open2(c, codec, &options);
    av_dict_free(&options);
    if (rc < 0)
        avcodec_free_context(&c);
    v->codec = c;
    return rc;
}

/* The first codec of the kind that this machine has. */
static int writer_open_codec(struct video_writer *v)
{
    int rc = AVERROR_ENCODER_NOT_FOUND;

    for (const struct writer_codec *w = v->kind->codec;
         rc < 0 && w->id != AV_CODEC_ID_NONE; w++)
        rc = writer_try(v, w);
    return rc;
}

/* Stream, sound, file and header; a libav error number. */
static int writer_begin(struct video_writer *v)
{
    const AVCodecContext *c = v->codec;
    AVDictionary *options = NULL;
    char *url;
    int rc;

    v->stream = avformat_new_stream(v->file, NULL);
    v->packet = av_packet_alloc();
    if (!v->stream || !v->packet)
        return AVERROR(ENOMEM);
    v->stream->time_base = c->time_base;
    v->stream->avg_frame_rate = c->framerate;
    rc = avcodec_parameters_from_context(v->stream->codecpar, c);
    if (rc < 0)
        return rc;
    if (v->kind->alpha == ALPHA && file_ends(v->path, ".webm"))
        av_dict_set(&v->stream->metadata, "alpha_mode", "1", 0);
    if (v->opt.sound && video_has_sound(v->path))
        v->sound = sound_open(v->opt.sound, v->opt.start, v->file);
    if (v->sound)
        v->lead = sound_lead(v->sound);
    av_dict_set(&v->file->metadata, "comment", v->opt.comment, 0);
    url = reader_url(v->path);
    rc = url ? avio_open(&v->file->pb, url, AVIO_FLAG_WRITE)
             : AVERROR(ENOMEM);
    free(url);
    if (rc < 0)
        return rc;
    v->file->flags |= AVFMT_FLAG_BITEXACT;
    rc = av_dict_parse_string(&options, v->kind->muxer, "=", ":", 0);
    if (rc >= 0)
        rc = avformat_write_header(v->file, &options);
    av_dict_free(&options);
    return rc;
}

/* A frame of these pixels with room; NULL without memory. */
static AVFrame *writer_frame(const struct video_writer *v,
                             enum AVPixelFormat pixels)
{
    AVFrame *f = av_frame_alloc();

    if (!f)
        return NULL;
    f->format = pixels;
    f->width = v->codec->width;
    f->height = v->codec->height;
    f->color_range = v->codec->color_range;
    f->colorspace = v->codec->colorspace;
    if (av_frame_get_buffer(f, 0) < 0)
        av_frame_free(&f);
    return f;
}

/* What comes to the encoder's pixels, by the matrix that is written. */
static int writer_open_colours(struct video_writer *v)
{
    const AVCodecContext *c = v->codec;
    const int *matrix = sws_getCoefficients(
        c->colorspace == AVCOL_SPC_BT709 ? SWS_CS_ITU709 : SWS_CS_ITU601);
    const size_t bytes = v->opt.alpha ? 4 : 3;
    const bool palette = c->pix_fmt == AV_PIX_FMT_PAL8;

    v->frame = writer_frame(v, palette ? AV_PIX_FMT_BGRA : c->pix_fmt);
    if (!v->frame)
        return AVERROR(ENOMEM);
    if ((size_t)c->width != v->opt.width ||
        (size_t)c->height != v->opt.height) {
        v->even = malloc(bytes * (size_t)c->width * (size_t)c->height);
        if (!v->even)
            return AVERROR(ENOMEM);
    }
    v->convert = sws_getContext(c->width, c->height, writer_plain(v), c->width,
                                c->height,
                                (enum AVPixelFormat)v->frame->format,
                                SWS_BICUBIC, NULL, NULL, NULL);
    if (!v->convert)
        return AVERROR(ENOMEM);
    sws_setColorspaceDetails(v->convert, matrix, 1, matrix, 0, 0, 1 << 16,
                             1 << 16);
    if (!palette)
        return 0;
    const struct filter_module *m = module_filter();

    v->plain = av_frame_alloc();
    v->palette = m ? m->open(PALETTE, v->frame, 1, 100) : NULL;
    return v->plain && v->palette ? 0 : AVERROR_FILTER_NOT_FOUND;
}

/* What a file of that name is. */
static const struct writer_kind *writer_kind_of(const char *path, bool alpha)
{
    const struct writer_kind *k = kinds;

    while (*k->ending && !(file_ends(path, k->ending) &&
                           k->alpha != (alpha ? OPAQUE : ALPHA)))
        k++;
    return k;
}

struct video_writer *writer_create(const char *path,
                                   const struct video_options *opt,
                                   struct error *err)
{
    struct video_writer *v = calloc(1, sizeof *v);

    av_log_set_level(AV_LOG_QUIET);
    if (!v || !(v->path = strdup(path))) {
        free(v);
        return error_null(err, EX_OSERR, "%s: out of memory", path);
    }
    v->opt = *opt;
    v->kind = writer_kind_of(path, opt->alpha);
    if (avformat_alloc_output_context2(&v->file, NULL, v->kind->format,
                                       path) < 0 ||
        writer_open_codec(v) < 0 || writer_begin(v) < 0 ||
        writer_open_colours(v) < 0) {
        writer_abandon(v);
        return error_null(err, EX_CANTCREAT, "%s: cannot create a video (no "
                          "encoder, or the directory cannot be written)",
                          path);
    }
    return v;
}

/* ---- frames -------------------------------------------------------------- */

/* What the encoder has ready goes into the file, and the sound up to there.
 * hold: steps that the last frame is shown, once it is the last. */
static int writer_drain(struct video_writer *v, int64_t hold)
{
    int rc;

    while ((rc = avcodec_receive_packet(v->codec, v->packet)) >= 0) {
        const double from = (double)v->packet->pts *
                            av_q2d(v->codec->time_base);
        const int64_t lead = llround(v->lead / av_q2d(v->stream->time_base));

        if (hold && v->packet->pts == v->frame->pts)
            v->packet->duration = hold;
        rc = v->sound ? sound_write(v->sound, from) : 0;
        av_packet_rescale_ts(v->packet, v->codec->time_base,
                             v->stream->time_base);
        v->packet->stream_index = v->stream->index;
        v->packet->pts += lead;
        v->packet->dts += lead;
        if (rc >= 0)
            rc = av_interleaved_write_frame(v->file, v->packet);
        if (rc < 0)
            return rc;
    }
    return rc == AVERROR(EAGAIN) || rc == AVERROR_EOF ? 0 : rc;
}

/* A frame to the encoder, or (NULL) that there is none; a libav error
 * number. */
static int writer_encode(struct video_writer *v, AVFrame *frame, int64_t hold)
{
    const int rc = avcodec_send_frame(v->codec, frame);

    return rc < 0 ? rc : writer_drain(v, hold);
}

/* The same by way of the filter that makes palettes. */
static int writer_encode_palette(struct video_writer *v, bool end, int64_t hold)
{
    const struct filter_module *m = module_filter();
    AVFrame *copy = end ? NULL : av_frame_clone(v->frame);
    int rc = copy || end ? m->send(v->palette, copy) : AVERROR(ENOMEM);

    av_frame_free(&copy);
    while (rc >= 0 && (rc = m->receive(v->palette, v->plain)) >= 0) {
        rc = writer_encode(v, v->plain, hold);
        av_frame_unref(v->plain);
    }
    return rc == AVERROR(EAGAIN) || rc == AVERROR_EOF ? 0 : rc;
}

/* The frame that was kept, which is shown until `until`. */
static int writer_send(struct video_writer *v, int64_t until, int64_t hold)
{
    if (v->count == 0)
        return 0;
    v->frame->pkt_duration = until - v->frame->pts;
    return v->palette ? writer_encode_palette(v, false, hold)
                      : writer_encode(v, v->frame, hold);
}

/* Pixels with the last column and row once more. */
static const uint8_t *writer_even(struct video_writer *v, const uint8_t *pixel)
{
    const size_t W = (size_t)v->codec->width, H = (size_t)v->codec->height;
    const size_t n = v->opt.alpha ? 4 : 3, w = v->opt.width;

    for (size_t y = 0; y < H; y++) {
        const uint8_t *from = pixel + n * w *
                              (y < v->opt.height ? y : v->opt.height - 1);
        uint8_t *to = v->even + n * W * y;

        memcpy(to, from, n * w);
        if (W > w)
            memcpy(to + n * w, from + n * (w - 1), n);
    }
    return v->even;
}

/* In steps from the first frame on; no frame before another. */
static int64_t writer_step(struct video_writer *v, double time)
{
    if (v->count == 0)
        v->first = time;
    const double step = (time - v->first) / av_q2d(v->codec->time_base);
    const int64_t at = step > (double)v->next && step < 1e15 ? llround(step)
                                                             : v->next;

    v->next = at + 1;
    return at;
}

int writer_write(struct video_writer *v, const uint8_t *pixel, double time,
                 struct error *err)
{
    const uint8_t *from[4] = {v->even ? writer_even(v, pixel) : pixel};
    const int stride[4] = {(v->opt.alpha ? 4 : 3) * v->codec->width};
    const int64_t at = writer_step(v, time);
    int rc = writer_send(v, at, 0);

    if (rc >= 0)
        rc = av_frame_make_writable(v->frame);
    if (rc < 0)
        return writer_fault(v, EX_IOERR, rc, err);
    sws_scale(v->convert, from, stride, 0, v->codec->height, v->frame->data,
              v->frame->linesize);
    v->frame->pts = at;
    v->count++;
    return 0;
}

/* How many steps the last frame is shown. */
static int64_t writer_hold(const struct video_writer *v, double end)
{
    const double second = 1 / av_q2d(v->codec->time_base);
    const double hold = end > 0 ? (end - v->first) * second -
                                  (double)v->frame->pts
                                : second / v->opt.rate;

    return hold > 1 && hold < 1e9 ? llround(hold) : 1;
}

/* The muxers of animations are told how long the last frame is shown. */
static void writer_tell_hold(struct video_writer *v, int64_t hold)
{
    char text[48];

    if (v->codec->codec_id == AV_CODEC_ID_GIF)
        av_opt_set_int(v->file->priv_data, "final_delay",
                       hold < 65535 ? hold : 65535, 0);
    if (v->codec->codec_id == AV_CODEC_ID_APNG) {
        snprintf(text, sizeof text, "%lld/%d", (long long)hold,
                 v->codec->time_base.den);
        av_opt_set(v->file->priv_data, "final_delay", text, 0);
    }
}

int writer_finish(struct video_writer *v, double end, struct error *err)
{
    const int64_t hold = v->count ? writer_hold(v, end) : 1;
    int rc = v->count ? writer_send(v, v->frame->pts + hold, hold) : 0, closed;

    if (rc >= 0 && v->palette)
        rc = writer_encode_palette(v, true, hold);
    if (rc >= 0)
        rc = writer_encode(v, NULL, hold);
    if (rc >= 0 && v->sound)
        rc = sound_write(v->sound, end != 0 ? INFINITY
                                   : (double)v->next *
                                     av_q2d(v->codec->time_base));
    writer_tell_hold(v, hold);
    if (rc >= 0)
        rc = av_write_trailer(v->file);
    if (rc >= 0)
        rc = v->file->pb->error;
    closed = avio_closep(&v->file->pb);
    rc = rc < 0 ? rc : closed;
    if (rc < 0)
        rc = writer_fault(v, EX_IOERR, rc, err);
    writer_abandon(v);
    return rc < 0 ? -1 : 0;
}
