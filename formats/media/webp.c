/* WebP by libwebp: pictures with their profile and Exif, and animations, which
 * ffmpeg of Debian 12 does not decode. */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include <webp/decode.h>
#include <webp/demux.h>

#include "formats/exif.h"
#include "formats/media/still.h"

/* ---- pictures ------------------------------------------------------------ */

/* What stands beside the pixels. */
static struct door_tag webp_tag(const WebPDemuxer *file)
{
    struct door_tag t = {.alpha = true, .pixels = {.channels = 3, .extra = 1,
                                                   .bits = 8}};
    WebPChunkIterator chunk;

    if (WebPDemuxGetChunk(file, "ICCP", 1, &chunk)) {
        t.colour.icc = chunk.chunk.bytes;
        t.colour.icc_bytes = chunk.chunk.size;
        WebPDemuxReleaseChunkIterator(&chunk);
    }
    if (WebPDemuxGetChunk(file, "EXIF", 1, &chunk)) {
        exif_read(&t, chunk.chunk.bytes, chunk.chunk.size);
        WebPDemuxReleaseChunkIterator(&chunk);
    }
    return t;
}

/* Composed frames of n bytes as RGBA; NULL and *err. */
static WebPAnimDecoder *webp_decoder(const uint8_t *data, size_t n,
                                     WebPAnimInfo *info, const char *name,
                                     struct error *err)
{
    const WebPData whole = {data, n};
    WebPBitstreamFeatures f = {0};
    WebPAnimDecoderOptions opt;
    WebPAnimDecoder *d = NULL;

    if (WebPGetFeatures(data, n, &f) == VP8_STATUS_OK &&
        door_check_size((size_t)f.width, (size_t)f.height, name, err))
        return NULL;            /* before any memory is asked for */
    if (WebPAnimDecoderOptionsInit(&opt))
        d = WebPAnimDecoderNew(&whole, &opt);
    if (d && WebPAnimDecoderGetInfo(d, info))
        return d;
    WebPAnimDecoderDelete(d);
    return error_null(err, EX_DATAERR, "%s: not a picture that can be read",
                      name);
}

int webp_read(struct image *im, const uint8_t *data, size_t n,
              const char *name, struct error *err)
{
    WebPAnimInfo info;
    WebPAnimDecoder *d = webp_decoder(data, n, &info, name, err);
    struct door door = {0};
    uint8_t *rgba;
    int rc, time;

    if (!d)
        return -1;
    const struct door_tag tag = webp_tag(WebPAnimDecoderGetDemuxer(d));

    rc = WebPAnimDecoderGetNext(d, &rgba, &time)
       ? door_picture(&door, im, info.canvas_width, info.canvas_height, &tag,
                      rgba, 4 * (size_t)info.canvas_width, name, err)
       : error_set(err, EX_DATAERR, "%s: damaged picture: cut short", name);
    door_release(&door);
    WebPAnimDecoderDelete(d);
    return rc;
}

/* ---- animations ---------------------------------------------------------- */

struct animation {
    struct video_reader base;
    char *path;
    uint8_t *data;
    WebPAnimDecoder *decoder;
    WebPAnimInfo info;
    struct door_tag tag;
    struct door door;
    struct image frame;         /* upright */
    size_t count;
};

static struct animation *animation_of(const struct video_reader *v)
{
    return (struct animation *)(uintptr_t)v;
}

/* Frames a second of which all durations are whole ones, or their mean where
 * that would be more than a hundred. */
static double animation_rate(const struct animation *a)
{
    int common = 0;
    double ms = 0, n = 0;
    WebPIterator it;

    if (!WebPDemuxGetFrame(WebPAnimDecoderGetDemuxer(a->decoder), 1, &it))
        return 0;
    do {
        for (int x = it.duration, y; x; x = y) {        /* Euclid's */
            y = common % x;
            common = x;
        }
        ms += it.duration;
        n++;
    } while (WebPDemuxNextFrame(&it));
    WebPDemuxReleaseIterator(&it);
    return common >= 10 ? 1000.0 / common : ms > 0 ? 1000 * n / ms : 0;
}

/* As video_read. */
static int animation_read(struct video_reader *v, const uint8_t **rgb,
                          size_t *width, size_t *height, double *time,
                          struct error *err)
{
    struct animation *a = animation_of(v);
    const size_t W = a->info.canvas_width;
    uint8_t *rgba;
    int end;

    if (!WebPAnimDecoderHasMoreFrames(a->decoder))
        return 0;
    if (!WebPAnimDecoderGetNext(a->decoder, &rgba, &end))
        return error_set(err, EX_DATAERR, "%s: frame %zu: damaged or cut "
                         "short", a->path, a->count);
    if (door_picture(&a->door, &a->frame, W, a->info.canvas_height, &a->tag,
                     rgba, 4 * W, a->path, err))
        return -1;
    *rgb = a->frame.rgb;
    *width = a->frame.width;
    *height = a->frame.height;
    *time = v->end;
    v->end = end / 1000.0;
    a->count++;
    return 1;
}

static void animation_close(struct video_reader *v)
{
    struct animation *a = animation_of(v);

    WebPAnimDecoderDelete(a->decoder);
    door_release(&a->door);
    free(a->frame.rgb);
    free(a->data);
    free(a->path);
    free(a);
}

static const struct video_reading animation_functions = {
    animation_read, animation_close
};

struct video_reader *webp_open(const char *path, struct error *err)
{
    struct animation *a = calloc(1, sizeof *a);
    size_t n;

    if (!a || !(a->path = strdup(path))) {
        free(a);
        return error_null(err, EX_OSERR, "%s: out of memory", path);
    }
    a->base.by = &animation_functions;
    a->data = still_load(path, &n, err);
    a->decoder = a->data ? webp_decoder(a->data, n, &a->info, path, err)
                         : NULL;
    if (a->decoder) {
        a->base.rate = animation_rate(a);
        a->base.frames = a->info.frame_count;
        a->tag = webp_tag(WebPAnimDecoderGetDemuxer(a->decoder));
        a->tag.alpha = false;   /* a driver is looked at, not laid over */
        return &a->base;
    }
    animation_close(&a->base);
    return NULL;
}
