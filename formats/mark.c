/* The mark's words, and its place in an MP4 file (ISO/IEC 14496-12; the item
 * list is Apple's): moov/udta/meta/ilst/(c)cmt/data. */
#include "formats/mark.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#define WORDS "Synthetic: drawn by the SpiD toolkit " SPID_VERSION \
    ", not a recording."

static bool off;

void mark_off(void)
{
    off = true;
}

const char *mark_text(void)
{
    return off ? NULL : WORDS;
}

const char *mark_xmp(void)
{
    static const char packet[] =
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf="
        "\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\"><rdf:Description "
        "xmlns:Iptc4xmpExt=\"http://iptc.org/std/Iptc4xmpExt/2008-02-29/\" "
        "Iptc4xmpExt:DigitalSourceType=\"http://cv.iptc.org/newscodes/"
        "digitalsourcetype/trainedAlgorithmicMedia\"/></rdf:RDF>"
        "</x:xmpmeta>";

    return off ? NULL : packet;
}

/* ---- MP4 ---------------------------------------------------------------- */

#define DEEPEST 4
static const char chain[DEEPEST][5] = {"moov", "udta", "meta", "ilst"};

/* The boxes of the chain that a file ends with: their places. */
struct mark_place {
    long at[DEEPEST];
    int depth;
    long end;                   /* of the file */
};

static uint32_t mark_get(const uint8_t *b)
{
    return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 |
           (uint32_t)b[2] << 8 | b[3];
}

static void mark_put(uint8_t *b, uint32_t v)
{
    for (int i = 0; i < 4; i++)
        b[i] = (uint8_t)(v >> (24 - 8 * i));
}

/* Size and type of the box at `at`; 0 at the end or where none can be. */
static long mark_box(FILE *f, long at, long end, char type[5])
{
    uint8_t b[16] = {0};
    uint64_t size;

    if (at + 8 > end || fseek(f, at, SEEK_SET) ||
        fread(b, 1, sizeof b, f) < 8)
        return 0;
    memcpy(type, b + 4, 4);
    type[4] = 0;
    size = mark_get(b);
    if (size == 1)              /* 64 bits follow */
        size = (uint64_t)mark_get(b + 8) << 32 | mark_get(b + 12);
    return size >= 8 && size <= (uint64_t)(end - at) ? (long)size : 0;
}

/* Find the last box between from and end if it is of that type. */
static bool mark_last(FILE *f, long from, long end, const char *want,
                      long *at)
{
    char type[5];
    long size;

    for (*at = from; (size = mark_box(f, *at, end, type)); *at += size)
        if (*at + size == end)
            return strcmp(type, want) == 0;
    return false;
}

/* How much of the chain the file ends with. */
static bool mark_find(FILE *f, struct mark_place *p)
{
    char type[5];
    long from = 0;

    p->depth = 0;
    if (fseek(f, 0, SEEK_END) || (p->end = ftell(f)) < 0 ||
        !mark_box(f, 0, p->end, type) || strcmp(type, "ftyp"))
        return false;
    while (p->depth < DEEPEST &&
           mark_last(f, from, p->end, chain[p->depth], &p->at[p->depth])) {
        /* meta is a full box: four bytes more of header */
        from = p->at[p->depth] + (p->depth == 2 ? 12 : 8);
        p->depth++;
    }
    return p->depth > 0;
}

/* Put a box's header in front of the *n bytes in b. */
static void mark_wrap(uint8_t *b, size_t *n, const char *type)
{
    memmove(b + 8, b, *n);
    *n += 8;
    mark_put(b, (uint32_t)*n);
    memcpy(b + 4, type, 4);
}

/* The item, in as many boxes of the chain as the file has not. */
static size_t mark_item(uint8_t *b, int depth)
{
    static const uint8_t handler[37] = {    /* meta's: version 0, then hdlr */
        0, 0, 0, 0, 0, 0, 0, 33, 'h', 'd', 'l', 'r', 0, 0, 0, 0, 0, 0, 0, 0,
        'm', 'd', 'i', 'r', 'a', 'p', 'p', 'l'
    };
    size_t n = 8 + strlen(WORDS);

    memset(b, 0, 8);
    b[3] = 1;                               /* UTF-8 */
    memcpy(b + 8, WORDS, strlen(WORDS));
    mark_wrap(b, &n, "data");
    mark_wrap(b, &n, "\251cmt");
    for (int d = DEEPEST - 1; d >= depth; d--) {
        if (d == 2) {
            memmove(b + sizeof handler, b, n);
            memcpy(b, handler, sizeof handler);
            n += sizeof handler;
        }
        mark_wrap(b, &n, chain[d]);
    }
    return n;
}

/* Append the item and make the boxes it lies in longer. */
static bool mark_append(FILE *f, const struct mark_place *p)
{
    uint8_t item[512], b[4];
    size_t n = mark_item(item, p->depth);

    if (fseek(f, p->end, SEEK_SET) || fwrite(item, 1, n, f) != n)
        return false;
    for (int d = 0; d < p->depth; d++) {
        if (fseek(f, p->at[d], SEEK_SET) || fread(b, 1, 4, f) != 4)
            return false;
        mark_put(b, mark_get(b) + (uint32_t)n);
        if (fseek(f, p->at[d], SEEK_SET) || fwrite(b, 1, 4, f) != 4)
            return false;
    }
    return true;
}

int mark_video(const char *path, struct error *err)
{
    struct mark_place p;
    FILE *f = off ? NULL : fopen(path, "r+b");
    int rc = 0;

    if (off)
        return 0;
    if (!f)
        return error_set(err, EX_IOERR, "%s: %s", path, strerror(errno));
    if (!mark_find(f, &p))
        rc = 1;
    else if (!mark_append(f, &p))
        rc = error_set(err, EX_IOERR, "%s: cannot write: %s", path,
                       strerror(errno));
    if (fclose(f) && rc >= 0)
        rc = error_set(err, EX_IOERR, "%s: cannot write: %s", path,
                       strerror(errno));
    return rc;
}
