/* The sound of a clip into a video that is written: as it is where the
 * container takes it, or else decoded, resampled and coded anew. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswresample/swresample.h>

#include "formats/video/table.h"

#define FRAME 1024              /* samples, of an encoder that takes any */

struct sound {
    AVFormatContext *in, *file;
    AVStream *from, *to;
    AVCodecContext *decoder, *encoder;  /* NULL: the packets are copied */
    SwrContext *resample;       /* and what the encoder has not had */
    AVPacket *packet, *coded;
    AVFrame *frame, *part;
    double shift;               /* of the clip's times to the file's */
    double lead;
    bool pending;               /* packet has been read, not written */
    bool ended;
    int64_t samples;            /* given to the encoder; its time, from */
    bool begun;
    int64_t last;               /* of the packets that were written */
};

void sound_close(struct sound *s)
{
    if (!s)
        return;
    av_packet_free(&s->packet);
    av_packet_free(&s->coded);
    av_frame_free(&s->frame);
    av_frame_free(&s->part);
    avcodec_free_context(&s->decoder);
    avcodec_free_context(&s->encoder);
    swr_free(&s->resample);
    avformat_close_input(&s->in);
    free(s);
}

double sound_lead(const struct sound *s)
{
    return s->lead;
}

/* ---- opening ------------------------------------------------------------- */

/* Whether players of the container know the codec: MP4 and AVI may hold more
 * than is ever played from them. */
static bool sound_fits(const AVOutputFormat *format, enum AVCodecID id)
{
    static const enum AVCodecID mp4[] = {
        AV_CODEC_ID_AAC, AV_CODEC_ID_MP3, AV_CODEC_ID_AC3, AV_CODEC_ID_EAC3,
        AV_CODEC_ID_ALAC
    };
    const bool apple = !strcmp(format->name, "mp4") ||
                       !strcmp(format->name, "mov");

    if (!strcmp(format->name, "avi"))
        return id == AV_CODEC_ID_MP3 || id == AV_CODEC_ID_AC3;
    for (size_t i = 0; apple && i < sizeof mp4 / sizeof *mp4; i++)
        if (mp4[i] == id)
            return true;
    return !apple && avformat_query_codec(format, id,
                                          FF_COMPLIANCE_NORMAL) == 1;
}

/* What the sound is coded as where it cannot stay. */
static enum AVCodecID sound_codec(const AVOutputFormat *format)
{
    return !strcmp(format->name, "webm") ? AV_CODEC_ID_OPUS
           : !strcmp(format->name, "avi") ? AV_CODEC_ID_MP3 : AV_CODEC_ID_AAC;
}

/* The clip's best sound; a libav error number. */
static int sound_open_clip(struct sound *s, const char *path)
{
    char *url = reader_url(path);
    int rc = url ? avformat_open_input(&s->in, url, NULL, NULL)
                 : AVERROR(ENOMEM);

    free(url);
    if (rc < 0 || (rc = avformat_find_stream_info(s->in, NULL)) < 0)
        return rc;
    rc = av_find_best_stream(s->in, AVMEDIA_TYPE_AUDIO, -1, -1, NULL, 0);
    if (rc < 0)
        return rc;
    s->from = s->in->streams[rc];
    for (unsigned i = 0; i < s->in->nb_streams; i++)
        if ((int)i != rc)
            s->in->streams[i]->discard = AVDISCARD_ALL;
    s->packet = av_packet_alloc();
    s->coded = av_packet_alloc();
    s->frame = av_frame_alloc();
    s->part = av_frame_alloc();
    return s->packet && s->coded && s->frame && s->part ? 0 : AVERROR(ENOMEM);
}

/* The rate nearest to what comes that the encoder knows. */
static int sound_rate(const AVCodec *codec, int rate)
{
    int best = codec->supported_samplerates ? 0 : rate;

    for (const int *r = codec->supported_samplerates; r && *r; r++)
        if (!best || abs(*r - rate) < abs(best - rate))
            best = *r;
    return best;
}

/* Decoder, encoder and what lies between; a libav error number. */
static int sound_open_codecs(struct sound *s)
{
    const AVCodecParameters *p = s->from->codecpar;
    const AVCodec *in = avcodec_find_decoder(p->codec_id);
    const AVCodec *out = avcodec_find_encoder(sound_codec(s->file->oformat));
    AVCodecContext *d, *e;
    int rc;

    if (!in || !out)
        return AVERROR_ENCODER_NOT_FOUND;
    s->decoder = d = avcodec_alloc_context3(in);
    s->encoder = e = avcodec_alloc_context3(out);
    if (!d || !e)
        return AVERROR(ENOMEM);
    d->pkt_timebase = s->from->time_base;
    if ((rc = avcodec_parameters_to_context(d, p)) < 0 ||
        (rc = avcodec_open2(d, in, NULL)) < 0)
        return rc;
    if (d->ch_layout.nb_channels < 1 || d->sample_rate < 1)
        return AVERROR_INVALIDDATA;
    av_channel_layout_default(&e->ch_layout, d->ch_layout.nb_channels > 1 ? 2
                                                                          : 1);
    e->sample_rate = sound_rate(out, d->sample_rate);
    e->sample_fmt = out->sample_fmts ? out->sample_fmts[0] : AV_SAMPLE_FMT_FLTP;
    e->bit_rate = 64000 * (int64_t)e->ch_layout.nb_channels;
    e->time_base = (AVRational){1, e->sample_rate};
    e->flags |= AV_CODEC_FLAG_BITEXACT;
    if (s->file->oformat->flags & AVFMT_GLOBALHEADER)
        e->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    if ((rc = avcodec_open2(e, out, NULL)) < 0)
        return rc;
    rc = swr_alloc_set_opts2(&s->resample, &e->ch_layout, e->sample_fmt,
                             e->sample_rate, &d->ch_layout, d->sample_fmt,
                             d->sample_rate, 0, NULL);
    return rc < 0 ? rc : swr_init(s->resample);
}

/* Its stream in the file; a libav error number. */
static int sound_open_stream(struct sound *s)
{
    const bool copy = sound_fits(s->file->oformat,
                                 s->from->codecpar->codec_id);
    int rc = copy ? 0 : sound_open_codecs(s);

    if (rc < 0)
        return rc;
    s->to = avformat_new_stream(s->file, NULL);
    if (!s->to)
        return AVERROR(ENOMEM);
    rc = copy ? avcodec_parameters_copy(s->to->codecpar, s->from->codecpar)
              : avcodec_parameters_from_context(s->to->codecpar, s->encoder);
    s->to->codecpar->codec_tag = 0;
    s->to->time_base = copy ? s->from->time_base : s->encoder->time_base;
    return rc;
}

/* How times move: what sounds before the first picture stays before it. */
static void sound_set_times(struct sound *s, double start)
{
    const AVCodecParameters *p = s->from->codecpar;
    double begin = start;

    if (s->from->start_time != AV_NOPTS_VALUE)
        begin = (double)s->from->start_time * av_q2d(s->from->time_base);
    if (p->sample_rate > 0)     /* silence that the decoder leaves out */
        begin += (double)p->initial_padding / p->sample_rate;
    s->lead = fmax(start - begin, 0);
    s->shift = s->lead - start;
    s->last = INT64_MIN;
}

struct sound *sound_open(const char *path, double start,
                         struct AVFormatContext *file)
{
    struct sound *s = calloc(1, sizeof *s);

    if (!s)
        return NULL;
    s->file = file;
    if (sound_open_clip(s, path) < 0 || sound_open_stream(s) < 0) {
        sound_close(s);
        return NULL;
    }
    sound_set_times(s, start);
    return s;
}

/* ---- packets ------------------------------------------------------------- */

/* The next packet of the clip's sound, in s->packet: 1; 0 at its end. */
static int sound_read(struct sound *s)
{
    while (!s->pending && !s->ended) {
        av_packet_unref(s->packet);
        if (av_read_frame(s->in, s->packet) < 0)
            s->ended = true;
        else
            s->pending = s->packet->stream_index == s->from->index;
    }
    return s->pending;
}

/* A packet into the file; times must grow. */
static int sound_put(struct sound *s, AVPacket *p)
{
    p->stream_index = s->to->index;
    if (p->dts == AV_NOPTS_VALUE)
        p->dts = p->pts;
    if (p->dts != AV_NOPTS_VALUE && p->dts <= s->last) {
        av_packet_unref(p);
        return 0;
    }
    if (p->dts != AV_NOPTS_VALUE)
        s->last = p->dts;
    return av_interleaved_write_frame(s->file, p);
}

/* The clip's own packet, in the file's times. */
static int sound_copy(struct sound *s)
{
    AVPacket *p = s->packet;
    const AVRational base = s->from->time_base;
    const int64_t shift = llround(s->shift / av_q2d(base));

    s->pending = false;
    if (p->flags & AV_PKT_FLAG_DISCARD && p->pts != AV_NOPTS_VALUE &&
        p->pts + p->duration < s->from->start_time) {
        av_packet_unref(p);     /* before what an edit list leaves */
        return 0;
    }
    if (p->pts != AV_NOPTS_VALUE)
        p->pts += shift;
    if (p->dts != AV_NOPTS_VALUE)
        p->dts += shift;
    p->pos = -1;
    av_packet_rescale_ts(p, base, s->to->time_base);
    return sound_put(s, p);
}

/* ---- coding anew --------------------------------------------------------- */

/* What the encoder has ready. */
static int sound_drain(struct sound *s)
{
    int rc;

    while ((rc = avcodec_receive_packet(s->encoder, s->coded)) >= 0) {
        av_packet_rescale_ts(s->coded, s->encoder->time_base,
                             s->to->time_base);
        if ((rc = sound_put(s, s->coded)) < 0)
            return rc;
    }
    return rc == AVERROR(EAGAIN) || rc == AVERROR_EOF ? 0 : rc;
}

/* As many samples as the encoder wants at a time; at the end also fewer.  Until
 * then a frame's worth stays behind, more than the resampler's filter is long. */
static int sound_encode(struct sound *s, bool end)
{
    AVCodecContext *e = s->encoder;
    const int want = e->frame_size ? e->frame_size : FRAME;
    const uint8_t **none = end ? NULL
                               : (const uint8_t **)s->frame->extended_data;
    AVFrame *f = s->part;
    int rc = 0, n = want;

    while (rc >= 0 && n == want &&
           (end || swr_get_delay(s->resample, e->sample_rate) >= want + FRAME)) {
        av_frame_unref(f);
        f->nb_samples = want;
        f->format = e->sample_fmt;
        f->sample_rate = e->sample_rate;
        if ((rc = av_channel_layout_copy(&f->ch_layout, &e->ch_layout)) < 0 ||
            (rc = av_frame_get_buffer(f, 0)) < 0)
            return rc;
        rc = n = swr_convert(s->resample, f->data, want, none, 0);
        if (n <= 0)
            break;
        f->nb_samples = n;
        f->pts = s->samples;
        s->samples += n;
        rc = avcodec_send_frame(e, f);
        if (rc >= 0)
            rc = sound_drain(s);
    }
    if (rc >= 0 && end && (rc = avcodec_send_frame(e, NULL)) >= 0)
        rc = sound_drain(s);
    return rc;
}

/* Silence where the clip has a gap, so that what follows stays in step. */
static int sound_fill(struct sound *s, int64_t at)
{
    const int64_t rate = s->encoder->sample_rate;
    int64_t gap = at - s->samples - swr_get_delay(s->resample, rate);
    int rc = 0;

    if (gap < rate / 20 || gap > 3600 * rate)
        return 0;
    gap = gap * s->decoder->sample_rate / rate;
    for (int n; rc >= 0 && gap > 0; gap -= n) {
        n = gap < FRAME ? (int)gap : FRAME;
        rc = swr_inject_silence(s->resample, n);
        if (rc >= 0)
            rc = sound_encode(s, false);
    }
    return rc;
}

/* Where in the file the decoded frame sounds, in samples. */
static int sound_place(struct sound *s)
{
    const int64_t at = s->frame->best_effort_timestamp;

    if (at == AV_NOPTS_VALUE)
        return 0;
    const double t = (double)at * av_q2d(s->from->time_base) + s->shift;
    const int64_t sample = llround(t * s->encoder->sample_rate);

    if (s->begun)
        return sound_fill(s, sample);
    s->begun = true;
    s->samples = sample;
    return 0;
}

/* The pending packet (or the end of them) decoded and coded anew. */
static int sound_recode(struct sound *s, bool end)
{
    int rc;

    s->pending = false;
    if (avcodec_send_packet(s->decoder, end ? NULL : s->packet) < 0 && !end)
        return 0;               /* a damaged packet is silent */
    while (avcodec_receive_frame(s->decoder, s->frame) >= 0) {
        if ((rc = sound_place(s)) < 0 ||
            (rc = swr_convert(s->resample, NULL, 0,
                              (const uint8_t **)s->frame->extended_data,
                              s->frame->nb_samples)) < 0 ||
            (rc = sound_encode(s, false)) < 0)
            return rc;
    }
    return end ? sound_encode(s, true) : 0;
}

int sound_write(struct sound *s, double until)
{
    int rc = 0;

    if (s->ended && !s->pending)
        return 0;
    while (rc >= 0 && sound_read(s)) {
        const int64_t at = s->packet->pts != AV_NOPTS_VALUE ? s->packet->pts
                                                            : s->packet->dts;

        if (at != AV_NOPTS_VALUE && isfinite(until) &&
            (double)at * av_q2d(s->from->time_base) + s->shift - s->lead >
                until)
            return 0;
        rc = s->encoder ? sound_recode(s, false) : sound_copy(s);
    }
    if (rc >= 0 && s->encoder)
        rc = sound_recode(s, true);
    return rc;
}
