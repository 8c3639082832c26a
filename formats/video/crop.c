/* Crop rectangles of containers, which ffmpeg of Debian 12 passes over: the
 * clean aperture of MP4 (ISO/IEC 14496-12) and PixelCrop of Matroska.  Those of
 * streams are the decoders'. */
#include <math.h>
#include <string.h>

#include <libavformat/avformat.h>
#include <libavutil/intreadwrite.h>

#include "formats/video/table.h"

#define DEEPEST 8

/* ---- MP4 ----------------------------------------------------------------- */

/* What is looked for while boxes are walked through. */
struct crop_walk {
    AVIOContext *io;
    int track, wanted;          /* of what is walked through; the stream's:
                                 * the number of MP4's, the place of
                                 * Matroska's, which is not told its number */
    double w, h;                /* pixels as stored */
    struct video_crop *crop;
};

/* n / d of eight bytes, for sizes that are not. */
static double crop_ratio(const uint8_t *b)
{
    const int32_t n = (int32_t)AV_RB32(b), d = (int32_t)AV_RB32(b + 4);

    return d ? (double)n / d : NAN;
}

/* The aperture: its size, and how far its middle is from the picture's. */
static void crop_aperture(struct crop_walk *c, const uint8_t b[32])
{
    const double w = crop_ratio(b), h = crop_ratio(b + 8);
    const double left = crop_ratio(b + 16) + (c->w - w) / 2;
    const double top = crop_ratio(b + 24) + (c->h - h) / 2;

    if (c->track != c->wanted || !(w >= 1 && h >= 1 && left >= 0 && top >= 0 &&
                                   left + w <= c->w && top + h <= c->h))
        return;
    c->crop->left = (size_t)lround(left);
    c->crop->top = (size_t)lround(top);
    c->crop->right = (size_t)lround(c->w - left - w);
    c->crop->bottom = (size_t)lround(c->h - top - h);
}

/* How many bytes of a box's own lie before the boxes in it; -1: there are
 * none. */
static int crop_inside(const uint8_t type[4])
{
    static const char plain[][5] = {"moov", "trak", "mdia", "minf", "stbl"};
    static const char video[][5] = {"avc1", "avc3", "hvc1", "hev1", "mp4v",
                                    "av01", "vp09", "apch", "apcn", "ap4h",
                                    "jpeg", "mjpa"};

    for (size_t i = 0; i < sizeof plain / sizeof *plain; i++)
        if (!memcmp(type, plain[i], 4))
            return 0;
    if (!memcmp(type, "stsd", 4))
        return 8;
    for (size_t i = 0; i < sizeof video / sizeof *video; i++)
        if (!memcmp(type, video[i], 4))
            return 78;
    return -1;
}

/* The boxes from `at` to `end`. */
static void crop_boxes(struct crop_walk *c, int64_t at, int64_t end, int deep)
{
    uint8_t b[36];

    while (at + 8 <= end && video_bytes(c->io, b, 8, at)) {
        int64_t size = AV_RB32(b), head = 8;
        const int inside = crop_inside(b + 4);

        if (size == 1 && video_bytes(c->io, b + 8, 8, at + 8)) {
            size = (int64_t)AV_RB64(b + 8);
            head = 16;
        }
        if (size < head || size > end - at)
            return;
        if (!memcmp(b + 4, "tkhd", 4) && video_bytes(c->io, b + 8, 24, at + 8))
            c->track = (int)AV_RB32(b + (b[8] ? 28 : 20));
        else if (!memcmp(b + 4, "clap", 4) && video_bytes(c->io, b, 32, at + 8))
            crop_aperture(c, b);
        else if (inside >= 0 && deep < DEEPEST)
            crop_boxes(c, at + head + inside, at + size, deep + 1);
        at += size;
    }
}

/* ---- Matroska ------------------------------------------------------------ */

/* Its length is coded in the leading zeros; all ones: not known. */
int64_t video_ebml(AVIOContext *io, int64_t *at, bool name)
{
    uint8_t b[8];
    int n = 1;

    if (!video_bytes(io, b, 1, *at) || b[0] == 0)
        return -1;
    while (!(b[0] & 0x80 >> (n - 1)))
        n++;
    if (n > 1 && !video_bytes(io, b + 1, n - 1, *at + 1))
        return -1;
    int64_t v = name ? b[0] : b[0] & (0x7f >> (n - 1));
    bool ones = v == 0x7f >> (n - 1);

    for (int i = 1; i < n; i++) {
        v = v << 8 | b[i];
        ones = ones && b[i] == 0xff;
    }
    *at += n;
    return ones && !name ? -1 : v;
}

/* The unsigned number that an element is. */
static size_t crop_number(AVIOContext *io, int64_t at, int64_t bytes)
{
    uint8_t b[8];
    size_t v = 0;

    if (bytes < 1 || bytes > 8 || !video_bytes(io, b, (int)bytes, at))
        return 0;
    for (int i = 0; i < bytes; i++)
        v = v << 8 | b[i];
    return v;
}

/* The elements from `at` to `end`. */
static void crop_elements(struct crop_walk *c, int64_t at, int64_t end,
                          int deep)
{
    while (at < end) {
        const int64_t name = video_ebml(c->io, &at, true);
        int64_t bytes = video_ebml(c->io, &at, false);
        struct video_crop *crop = c->crop;

        if (name < 0 || name == 0x1f43b675)     /* pictures from here on */
            return;
        if (bytes < 0 || bytes > end - at)
            bytes = end - at;
        c->track += name == 0xae;               /* tracks are counted */
        if (c->track == c->wanted && name == 0x54cc)
            crop->left = crop_number(c->io, at, bytes);
        else if (c->track == c->wanted && name == 0x54dd)
            crop->right = crop_number(c->io, at, bytes);
        else if (c->track == c->wanted && name == 0x54bb)
            crop->top = crop_number(c->io, at, bytes);
        else if (c->track == c->wanted && name == 0x54aa)
            crop->bottom = crop_number(c->io, at, bytes);
        else if ((name == 0x18538067 || name == 0x1654ae6b || name == 0xae ||
                  name == 0xe0) && deep < DEEPEST)
            crop_elements(c, at, at + bytes, deep + 1);
        at += bytes;
    }
}

/* ---- either -------------------------------------------------------------- */

bool video_bytes(AVIOContext *io, uint8_t *b, int n, int64_t at)
{
    return avio_seek(io, at, SEEK_SET) == at && avio_read(io, b, n) == n;
}

struct video_crop video_find_crop(AVFormatContext *file, const AVStream *stream)
{
    struct video_crop crop = {0};
    struct crop_walk c = {
        .io = file->pb, .crop = &crop,
        .w = stream->codecpar->width, .h = stream->codecpar->height
    };
    const bool mp4 = strstr(file->iformat->name, "mp4");
    const bool mkv = strstr(file->iformat->name, "matroska");

    if (!file->pb || !(file->pb->seekable & AVIO_SEEKABLE_NORMAL) ||
        !(mp4 || mkv))
        return crop;
    const int64_t place = avio_tell(file->pb), size = avio_size(file->pb);

    c.wanted = mp4 ? stream->id : stream->index;
    c.track = -1;
    if (mp4)
        crop_boxes(&c, 0, size, 0);
    else
        crop_elements(&c, 0, size, 0);
    avio_seek(file->pb, place, SEEK_SET);
    if (crop.left + crop.right >= (size_t)stream->codecpar->width ||
        crop.top + crop.bottom >= (size_t)stream->codecpar->height)
        crop = (struct video_crop){0};
    return crop;
}
