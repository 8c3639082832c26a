/* Video files out by ffmpeg's libraries: H.264, or the next best that is
 * there, in the container that the name says. */
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

struct video_writer {
    char *path;
    size_t width, height, count;
    double first;               /* time of the first frame */
    int64_t next;               /* the earliest step of the next */
    AVFormatContext *file;
    AVCodecContext *codec;
    struct SwsContext *convert;
    AVStream *stream;
    AVPacket *packet;
    AVFrame *frame;
    uint8_t *even;              /* rgb of even sides, where they are odd */
};

/* What libav says, with our path before it. */
static int writer_fault(const struct video_writer *v, int code, int number,
                        struct error *err)
{
    char why[AV_ERROR_MAX_STRING_SIZE];

    av_strerror(number, why, sizeof why);
    return error_set(err, code, "%s: frame %zu: %s", v->path, v->count, why);
}

void writer_abandon(struct video_writer *v)
{
    if (v->file && v->file->pb)
        avio_closep(&v->file->pb);
    sws_freeContext(v->convert);
    av_frame_free(&v->frame);
    av_packet_free(&v->packet);
    avcodec_free_context(&v->codec);
    avformat_free_context(v->file);
    free(v->even);
    free(v->path);
    free(v);
}

/* ---- opening ------------------------------------------------------------- */

/* An encoder as it will be used; a libav error number. */
static int writer_try(struct video_writer *v, enum AVCodecID id, double rate)
{
    const AVCodec *codec = avcodec_find_encoder(id);
    const AVRational step = av_inv_q(av_d2q(rate, 100000));
    AVCodecContext *c = codec ? avcodec_alloc_context3(codec) : NULL;
    int rc;

    if (!c)
        return AVERROR_ENCODER_NOT_FOUND;
    c->width = (int)(v->width + v->width % 2);
    c->height = (int)(v->height + v->height % 2);
    c->pix_fmt = AV_PIX_FMT_YUV420P;
    c->time_base = step;
    c->framerate = av_inv_q(step);
    c->thread_count = 1;        /* the same bytes on any machine */
    c->color_range = AVCOL_RANGE_MPEG;
    c->colorspace = video_is_hd(c->width, c->height) ? AVCOL_SPC_BT709
                                                     : AVCOL_SPC_SMPTE170M;
    c->flags |= AV_CODEC_FLAG_BITEXACT;
    if (v->file->oformat->flags & AVFMT_GLOBALHEADER)
        c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    if (id == AV_CODEC_ID_H264) {
        av_opt_set(c->priv_data, "preset", "veryfast", 0);
        av_opt_set(c->priv_data, "crf", "20", 0);
    } else {
        c->bit_rate = (int64_t)(4 * rate * c->width * c->height);
    }
    rc = avcodec_open2(c, codec, NULL);
    if (rc < 0)
        avcodec_free_context(&c);
    v->codec = c;
    return rc;
}

/* The first codec that this machine has. */
static int writer_open_codec(struct video_writer *v, double rate)
{
    static const enum AVCodecID any[] = {AV_CODEC_ID_H264, AV_CODEC_ID_MPEG4};
    static const enum AVCodecID webm[] = {AV_CODEC_ID_VP9, AV_CODEC_ID_VP8};
    const enum AVCodecID *id = file_ends(v->path, ".webm") ? webm : any;
    int rc = writer_try(v, id[0], rate);

    return rc < 0 ? writer_try(v, id[1], rate) : rc;
}

/* Stream, frame, file and header; a libav error number. */
static int writer_begin(struct video_writer *v)
{
    const AVCodecContext *c = v->codec;
    char *url;
    int rc;

    v->stream = avformat_new_stream(v->file, NULL);
    v->packet = av_packet_alloc();
    v->frame = av_frame_alloc();
    if (!v->stream || !v->packet || !v->frame)
        return AVERROR(ENOMEM);
    v->stream->time_base = c->time_base;
    v->stream->avg_frame_rate = c->framerate;
    rc = avcodec_parameters_from_context(v->stream->codecpar, c);
    v->frame->format = c->pix_fmt;
    v->frame->width = c->width;
    v->frame->height = c->height;
    v->frame->color_range = c->color_range;
    v->frame->colorspace = c->colorspace;
    if (rc < 0 || (rc = av_frame_get_buffer(v->frame, 0)) < 0)
        return rc;
    url = reader_url(v->path);
    rc = url ? avio_open(&v->file->pb, url, AVIO_FLAG_WRITE)
             : AVERROR(ENOMEM);
    free(url);
    if (rc < 0)
        return rc;
    v->file->flags |= AVFMT_FLAG_BITEXACT;
    return avformat_write_header(v->file, NULL);
}

/* RGB to the encoder's pixels, by the matrix that is written. */
static int writer_open_colours(struct video_writer *v)
{
    const AVCodecContext *c = v->codec;
    const int *matrix = sws_getCoefficients(
        c->colorspace == AVCOL_SPC_BT709 ? SWS_CS_ITU709 : SWS_CS_ITU601);

    if (v->width % 2 || v->height % 2) {
        v->even = malloc(3 * (size_t)c->width * (size_t)c->height);
        if (!v->even)
            return AVERROR(ENOMEM);
    }
    v->convert = sws_getContext(c->width, c->height, AV_PIX_FMT_RGB24,
                                c->width, c->height, c->pix_fmt, SWS_BICUBIC,
                                NULL, NULL, NULL);
    if (!v->convert)
        return AVERROR(ENOMEM);
    sws_setColorspaceDetails(v->convert, matrix, 1, matrix, 0, 0, 1 << 16,
                             1 << 16);
    return 0;
}

struct video_writer *writer_create(const char *path, size_t width,
                                   size_t height, double rate,
                                   struct error *err)
{
    struct video_writer *v = calloc(1, sizeof *v);

    av_log_set_level(AV_LOG_QUIET);
    if (!v || !(v->path = strdup(path))) {
        free(v);
        error_set(err, EX_OSERR, "%s: out of memory", path);
        return NULL;
    }
    v->width = width;
    v->height = height;
    if (avformat_alloc_output_context2(&v->file, NULL, NULL, path) < 0 ||
        writer_open_codec(v, rate) < 0 || writer_begin(v) < 0 ||
        writer_open_colours(v) < 0) {
        writer_abandon(v);
        error_set(err, EX_CANTCREAT, "%s: cannot create a video (no encoder, "
                  "or the directory cannot be written)", path);
        return NULL;
    }
    return v;
}

/* ---- frames -------------------------------------------------------------- */

/* What the encoder has ready goes into the file. */
static int writer_drain(struct video_writer *v)
{
    int rc;

    while ((rc = avcodec_receive_packet(v->codec, v->packet)) >= 0) {
        av_packet_rescale_ts(v->packet, v->codec->time_base,
                             v->stream->time_base);
        v->packet->stream_index = v->stream->index;
        rc = av_interleaved_write_frame(v->file, v->packet);
        if (rc < 0)
            return rc;
    }
    return rc == AVERROR(EAGAIN) || rc == AVERROR_EOF ? 0 : rc;
}

/* rgb with its last column and row once more. */
static const uint8_t *writer_even(struct video_writer *v, const uint8_t *rgb)
{
    const size_t W = (size_t)v->codec->width, H = (size_t)v->codec->height;

    for (size_t y = 0; y < H; y++) {
        const uint8_t *from = rgb + 3 * v->width *
                              (y < v->height ? y : v->height - 1);
        uint8_t *to = v->even + 3 * W * y;

        memcpy(to, from, 3 * v->width);
        if (W > v->width)
            memcpy(to + 3 * v->width, from + 3 * (v->width - 1), 3);
    }
    return v->even;
}

/* In steps of the rate from the first frame on; no frame before another. */
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

int writer_write(struct video_writer *v, const uint8_t *rgb, double time,
                 struct error *err)
{
    const uint8_t *from[4] = {v->even ? writer_even(v, rgb) : rgb};
    const int stride[4] = {3 * v->codec->width};
    int rc = av_frame_make_writable(v->frame);

    if (rc >= 0) {
        sws_scale(v->convert, from, stride, 0, v->codec->height,
                  v->frame->data, v->frame->linesize);
        v->frame->pts = writer_step(v, time);
        rc = avcodec_send_frame(v->codec, v->frame);
    }
    if (rc >= 0)
        rc = writer_drain(v);
    if (rc < 0)
        return writer_fault(v, EX_IOERR, rc, err);
    v->count++;
    return 0;
}

int writer_finish(struct video_writer *v, struct error *err)
{
    int rc = avcodec_send_frame(v->codec, NULL), closed;

    if (rc >= 0)
        rc = writer_drain(v);
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
