/* Header and table of a record, written and checked. A reader trusts nothing:
 * every number is compared with what is left before it is used. */
#include "lib/stream/layout.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>
#include <xxhash.h>

/* A record's type for a message: unprintable letters shown as '?'. */
static void layout_type_text(char text[5], const char type[4])
{
    for (int i = 0; i < 4; i++)
        text[i] = type[i] >= ' ' && type[i] <= '~' ? type[i] : '?';
    text[4] = '\0';
}

void layout_put_header(struct layout_header *h, const char *type,
                       uint64_t frame, double time, int count,
                       size_t payload_bytes, uint64_t payload_hash)
{
    memset(h, 0, sizeof *h);
    memcpy(h->magic, STREAM_MAGIC, sizeof h->magic);
    h->version = STREAM_VERSION;
    h->bytes = HEADER_BYTES;
    memcpy(h->type, type, 4);
    h->count = (uint32_t)count;
    h->frame = frame;
    h->time = time;
    h->payload_bytes = payload_bytes;
    h->payload_hash = payload_hash;
    h->check = XXH3_64bits(h, HEADER_HASHED);
}

/* Four printable characters, the first no blank. */
static bool layout_type_is_valid(const char type[4])
{
    for (int i = 0; i < 4; i++)
        if (type[i] < ' ' || type[i] > '~')
            return false;
    return type[0] != ' ';
}

/* The header is what it claims to be, whatever its values. */
static int layout_check_envelope(const struct layout_header *h,
                                 struct error *err)
{
    char magic[5];

    if (memcmp(h->magic, STREAM_MAGIC, sizeof h->magic) != 0) {
        layout_type_text(magic, h->magic);
        return error_set(err, EX_DATAERR, "not a record: it starts with '%s' "
                         "(expected '" STREAM_MAGIC "')", magic);
    }
    if (h->check != XXH3_64bits(h, HEADER_HASHED))
        return error_set(err, EX_DATAERR, "header checksum %016llx does not "
                         "match (expected %016llx)",
                         (unsigned long long)h->check,
                         (unsigned long long)XXH3_64bits(h, HEADER_HASHED));
    if (h->version != STREAM_VERSION)
        return error_set(err, EX_DATAERR, "format version %u (expected %d)",
                         h->version, STREAM_VERSION);
    if (h->bytes != HEADER_BYTES)
        return error_set(err, EX_DATAERR, "header of %u bytes (expected %d)",
                         h->bytes, HEADER_BYTES);
    if (h->zero != 0)
        return error_set(err, EX_DATAERR, "last 8 header bytes are not zero");
    return 0;
}

int layout_get_header(struct record *rec, const struct layout_header *h,
                      size_t max_bytes, struct error *err)
{
    if (layout_check_envelope(h, err))
        return -1;
    layout_type_text(rec->type, h->type);
    if (!layout_type_is_valid(h->type))
        return error_set(err, EX_DATAERR, "record type '%s' (expected four "
                         "printable letters)", rec->type);
    if (!isfinite(h->time))
        return error_set(err, EX_DATAERR, "%s time is not finite", rec->type);
    if (h->count > STREAM_MAX_ARRAYS)
        return error_set(err, EX_DATAERR, "%s has %u arrays (at most %d)",
                         rec->type, h->count, STREAM_MAX_ARRAYS);
    if (h->payload_bytes > max_bytes)
        return error_set(err, EX_DATAERR, "%s payload of %llu bytes (at most "
                         "%zu, see --max-bytes)", rec->type,
                         (unsigned long long)h->payload_bytes, max_bytes);
    if (h->payload_bytes % STREAM_ALIGN ||
        h->payload_bytes < (uint64_t)h->count * ENTRY_BYTES)
        return error_set(err, EX_DATAERR, "%s payload of %llu bytes cannot "
                         "hold %u arrays", rec->type,
                         (unsigned long long)h->payload_bytes, h->count);
    rec->frame = h->frame;
    rec->time = h->time;
    rec->count = (int)h->count;
    rec->payload = NULL;
    rec->payload_bytes = (size_t)h->payload_bytes;
    rec->payload_hash = h->payload_hash;
    return 0;
}

/* One to 23 printable characters, then NULs to the end. */
static bool layout_name_is_valid(const char name[STREAM_NAME])
{
    size_t n = strnlen(name, STREAM_NAME);

    if (n == 0 || n == STREAM_NAME)
        return false;
    for (size_t i = 0; i < n; i++)
        if (name[i] <= ' ' || name[i] > '~')
            return false;
    for (size_t i = n; i < STREAM_NAME; i++)
        if (name[i])
            return false;
    return true;
}

int layout_put_table(struct layout_entry *table, size_t *payload_bytes,
                     const struct array *arrays, int count,
                     struct error *err)
{
    size_t offset = (size_t)count * ENTRY_BYTES;

    for (int i = 0; i < count; i++) {
        const struct array *a = &arrays[i];
        struct layout_entry *e = &table[i];

        memset(e, 0, sizeof *e);
        memcpy(e->name, a->name, strnlen(a->name, STREAM_NAME));
        if (!layout_name_is_valid(e->name))
            return error_set(err, EX_SOFTWARE, "array %d has no valid name",
                             i);
        for (int j = 0; j < i; j++)
            if (strcmp(table[j].name, e->name) == 0)
                return error_set(err, EX_SOFTWARE, "two arrays '%s'",
                                 e->name);
        for (int k = 0; k < a->ndim; k++) {
            if (a->dim[k] > UINT32_MAX)
                return error_set(err, EX_SOFTWARE, "%s is too large",
                                 e->name);
            e->dim[k] = (uint32_t)a->dim[k];
        }
        e->dtype = (uint32_t)a->dtype;
        e->ndim = (uint32_t)a->ndim;
        e->offset = offset;
        e->bytes = array_bytes(a);
        offset = layout_align(offset + e->bytes);
    }
    *payload_bytes = offset;
    return 0;
}

/* Bytes of the entry's shape, or -1 when that overflows or exceeds limit. */
static int layout_shape_bytes(size_t *bytes, const struct layout_entry *e,
                              size_t limit)
{
    unsigned __int128 n = dtype_size((enum dtype)e->dtype);
    bool empty = false;

    for (uint32_t k = 0; k < e->ndim; k++) {
        if (e->dim[k] == 0)
            empty = true;
        else if ((n *= e->dim[k]) > limit)
            n = (unsigned __int128)limit + 1; /* stays too large */
    }
    if (empty)
        n = 0;
    *bytes = (size_t)n;
    return n > limit ? -1 : 0;
}

/* One array's row, whose data must begin at offset and end by end. */
static int layout_get_entry(struct array *a, const struct layout_entry *e,
                            const char *type, size_t offset, size_t end,
                            struct error *err)
{
    size_t bytes;

    if (!layout_name_is_valid(e->name))
        return error_set(err, EX_DATAERR, "%s has an array without a valid "
                         "name", type);
    if (e->dtype > DTYPE_F64)
        return error_set(err, EX_DATAERR, "%s %s has dtype %u (expected 0 to "
                         "%d)", type, e->name, e->dtype, DTYPE_F64);
    if (e->ndim > 4)
        return error_set(err, EX_DATAERR, "%s %s has %u dimensions (expected "
                         "0 to 4)", type, e->name, e->ndim);
    for (uint32_t k = e->ndim; k < 4; k++)
        if (e->dim[k])
            return error_set(err, EX_DATAERR, "%s %s has %u dimensions but "
                             "number %u is %u (expected 0)", type, e->name,
                             e->ndim, k, e->dim[k]);
    if (e->offset != offset)
        return error_set(err, EX_DATAERR, "%s %s at offset %llu (expected "
                         "%zu)", type, e->name,
                         (unsigned long long)e->offset, offset);
    if (layout_shape_bytes(&bytes, e, end - offset) || e->bytes != bytes)
        return error_set(err, EX_DATAERR, "%s %s of %llu bytes does not fit "
                         "its shape or the %zu bytes left", type, e->name,
                         (unsigned long long)e->bytes, end - offset);
    memcpy(a->name, e->name, STREAM_NAME);
    a->dtype = (enum dtype)e->dtype;
    a->ndim = (int)e->ndim;
    for (int k = 0; k < 4; k++)
        a->dim[k] = e->dim[k];
    a->data = NULL;
    return 0;
}

int layout_get_table(struct record *rec, const struct layout_entry *table,
                     struct error *err)
{
    size_t end = rec->payload_bytes;
    size_t offset = (size_t)rec->count * ENTRY_BYTES;

    for (int i = 0; i < rec->count; i++) {
        struct array *a = &rec->array[i];

        if (layout_get_entry(a, &table[i], rec->type, offset, end, err))
            return -1;
        for (int j = 0; j < i; j++)
            if (strcmp(rec->array[j].name, a->name) == 0)
                return error_set(err, EX_DATAERR, "%s has two arrays '%s'",
                                 rec->type, a->name);
        /* end is a multiple of 64, so the aligned offset stays within it. */
        offset = layout_align(offset + array_bytes(a));
    }
    if (offset != end)
        return error_set(err, EX_DATAERR, "%s payload of %zu bytes (its "
                         "arrays take %zu)", rec->type, end, offset);
    return 0;
}

int layout_attach(struct record *rec, const unsigned char *payload,
                  struct error *err)
{
    size_t offset = (size_t)rec->count * ENTRY_BYTES;

    rec->payload = payload;
    for (int i = 0; i < rec->count; i++) {
        struct array *a = &rec->array[i];
        size_t stop = offset + array_bytes(a);

        a->data = payload + offset;
        offset = layout_align(stop);
        for (; stop < offset; stop++)
            if (payload[stop])
                return error_set(err, EX_DATAERR, "%s padding after %s is "
                                 "not zero", rec->type, a->name);
    }
    return 0;
}
