/* libFuzzer target: the stream reader.  The first byte says whether checksums
 * are made right before reading, so that what lies behind them is reached. */
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#include "lib/stream/layout.h"
#include "lib/stream/schema.h"
#include "lib/stream/stats.h"
#include "lib/stream/stream.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Walk the records and repair magic and checksums as far as they reach. */
static void stream_repair(unsigned char *p, size_t size)
{
    struct layout_header h;

    for (size_t at = 0; at + sizeof h <= size;) {
        size_t left = size - at - sizeof h;

        memcpy(&h, p + at, sizeof h);
        memcpy(h.magic, "SPID", 4);
        h.version = STREAM_VERSION;
        h.bytes = HEADER_BYTES;
        h.zero = 0;
        if (h.payload_bytes <= left)
            h.payload_hash = XXH3_64bits(p + at + sizeof h, h.payload_bytes);
        h.check = XXH3_64bits(&h, HEADER_HASHED);
        memcpy(p + at, &h, sizeof h);
        if (h.payload_bytes > left)
            return;
        at += sizeof h + h.payload_bytes;
    }
}

/* What a program does with a good record; its table must encode again to the
 * same bytes. */
static void stream_use(const struct record *rec)
{
    struct layout_entry table[STREAM_MAX_ARRAYS];
    struct array_stats s;
    size_t bytes;

    record_check_finite(rec, NULL);
    schema_check(rec, NULL);
    for (int i = 0; i < rec->count; i++)
        array_stats(&s, &rec->array[i]);
    if (layout_put_table(table, &bytes, rec->array, rec->count, NULL) ||
        bytes != rec->payload_bytes ||
        memcmp(table, rec->payload, (size_t)rec->count * ENTRY_BYTES))
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct stream_options opt = { .max_bytes = 1 << 20 };
    struct stream_reader *r;
    struct error err;
    struct record rec;
    unsigned char *copy;

    if (size < 1)
        return 0;
    copy = aligned_alloc(64, (size + 63) / 64 * 64);
    if (!copy)
        return 0;
    memcpy(copy, data + 1, size - 1);
    opt.trust = data[0] & 2;
    if (data[0] & 1)
        stream_repair(copy, size - 1);
    r = stream_open_memory(copy, size - 1, "fuzz", &opt, &err);
    while (r && stream_read(r, &rec, &err) > 0)
        stream_use(&rec);
    stream_close(r);
    free(copy);
    return 0;
}
