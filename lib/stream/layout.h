/* The bytes of a record: header, table of arrays, aligned data.  Internal to
 * lib/stream; man/spid-stream.5 describes the same in words. */
#ifndef SPID_STREAM_LAYOUT_H
#define SPID_STREAM_LAYOUT_H

#include "lib/stream/stream.h"

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "streams are little-endian and are used in place"
#endif

#define HEADER_BYTES 64
#define ENTRY_BYTES 64
#define HEADER_HASHED 48       /* bytes covered by header.check */

struct layout_header {
    char magic[4];             /* STREAM_MAGIC */
    uint16_t version;          /* STREAM_VERSION */
    uint16_t bytes;            /* HEADER_BYTES */
    char type[4];
    uint32_t count;            /* arrays */
    uint64_t frame;
    double time;
    uint64_t payload_bytes;
    uint64_t payload_hash;     /* XXH3-64 of the payload */
    uint64_t check;            /* XXH3-64 of the first 48 bytes */
    uint64_t zero;
};

struct layout_entry {
    char name[STREAM_NAME];    /* NUL padded */
    uint32_t dtype;
    uint32_t ndim;
    uint32_t dim[4];           /* 0 from ndim on */
    uint64_t offset;           /* from the payload's start */
    uint64_t bytes;
};

_Static_assert(sizeof(struct layout_header) == HEADER_BYTES, "header");
_Static_assert(sizeof(struct layout_entry) == ENTRY_BYTES, "entry");

/* Next multiple of STREAM_ALIGN; n <= SIZE_MAX - 63. */
static inline size_t layout_align(size_t n)
{
    return (n + STREAM_ALIGN - 1) & ~(size_t)(STREAM_ALIGN - 1);
}

/* Header of a record whose payload size and hash are known. */
void layout_put_header(struct layout_header *h, const char *type,
                       uint64_t frame, double time, int count,
                       size_t payload_bytes, uint64_t payload_hash);

/* Check a header and fill rec's type, frame, time, count and payload_*.
 * payload_bytes is within max_bytes afterwards. */
int layout_get_header(struct record *rec, const struct layout_header *h,
                      size_t max_bytes, struct error *err);

/* Fill table from arrays and *payload_bytes with the size of it all. */
int layout_put_table(struct layout_entry *table, size_t *payload_bytes,
                     const struct array *arrays, int count,
                     struct error *err);

/* Check a table against rec->count and rec->payload_bytes and fill the
 * arrays but their data. */
int layout_get_table(struct record *rec, const struct layout_entry *table,
                     struct error *err);

/* Point the arrays into payload and check that the padding is zero. */
int layout_attach(struct record *rec, const unsigned char *payload,
                  struct error *err);

#endif
