/* Files that are shorter than they say.  Where the end of a file is missing,
 * most demuxers end as at a whole one's; but nearly every container says how
 * long it is, or what lies where. */
#include <string.h>

#include <libavformat/avformat.h>

#include "formats/video/table.h"

/* MPEG-TS has no index and announces nothing, but it is made of packets of 188
 * bytes that start with 0x47 (192 with a time before each in M2TS, 204 with
 * parity behind): a file that ends inside one was cut. */
static bool cut_transport(AVIOContext *io, int64_t size)
{
    static const int packet[3] = {188, 192, 204}, sync[3] = {0, 4, 0};
    uint8_t head[4 * 204];

    if (!video_bytes(io, head, sizeof head, 0))
        return false;
    for (int i = 0; i < 3; i++) {
        bool all = true;

        for (int at = sync[i]; at < (int)sizeof head; at += packet[i])
            all = all && head[at] == 0x47;
        if (all)
            return size % packet[i] != 0;
    }
    return false;
}

/* Matroska, WebM: the segment, which holds all, has a length. */
static bool cut_matroska(AVIOContext *io, int64_t size)
{
    int64_t at = 0;

    while (at < size) {
        const int64_t name = video_ebml(io, &at, true);
        const int64_t bytes = video_ebml(io, &at, false);

        if (name < 0 || bytes < 0)
            return false;
        if (name == 0x18538067)                 /* Segment */
            return at + bytes > size;
        at += bytes;
    }
    return false;
}

/* n bytes, the low one first. */
static int64_t cut_number(const uint8_t *b, int n)
{
    uint64_t v = 0;

    while (n--)
        v = v << 8 | b[n];
    return (int64_t)v;
}

/* AVI: the length of the first chunk; 0 or all ones while it is recorded. */
static bool cut_riff(AVIOContext *io, int64_t size)
{
    uint8_t b[8];

    if (!video_bytes(io, b, sizeof b, 0) || memcmp(b, "RIFF", 4))
        return false;
    const int64_t bytes = cut_number(b + 4, 4);

    return bytes < 0xffffff00 && 8 + bytes > size;
}

/* ASF, WMV: the file properties object has the file's length. */
static bool cut_asf(AVIOContext *io, int64_t size)
{
    static const uint8_t properties[16] = {
        0xa1, 0xdc, 0xab, 0x8c, 0x47, 0xa9, 0xcf, 0x11, 0x8e, 0xe4, 0x00, 0xc0,
        0x0c, 0x20, 0x53, 0x65
    };
    int64_t at = 30;            /* behind the header object's own head */
    uint8_t b[48];

    for (int i = 0; i < 64 && video_bytes(io, b, sizeof b, at); i++) {
        const int64_t bytes = cut_number(b + 16, 8);

        if (!memcmp(b, properties, sizeof properties))
            return cut_number(b + 40, 8) > size;
        if (bytes < 24 || bytes > size)
            return false;
        at += bytes;
    }
    return false;
}

/* Samples whose place in the file is behind its end. */
static bool cut_index(const AVStream *s, int64_t size)
{
    const int n = avformat_index_get_entries_count(s);

    for (int i = 0; i < n; i++) {
        const AVIndexEntry *e = avformat_index_get_entry((AVStream *)s, i);

        if (e->pos >= 0 && e->pos + e->size > size)
            return true;
    }
    return false;
}

bool video_is_cut(const AVFormatContext *file, const AVStream *stream)
{
    const char *kind = file->iformat->name;
    const int64_t size = file->pb ? avio_size(file->pb) : -1;

    if (size <= 0)
        return false;
    if (strstr(kind, "mpegts"))
        return cut_transport(file->pb, size);
    if (strstr(kind, "matroska"))
        return cut_matroska(file->pb, size);
    if (!strcmp(kind, "asf"))
        return cut_asf(file->pb, size);
    return (!strcmp(kind, "avi") && cut_riff(file->pb, size)) ||
           cut_index(stream, size);
}
