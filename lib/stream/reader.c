/* Reading records: from a mapped file in place, from a pipe in large blocks,
 * hashing each block while it is still in the cache. */
#include "lib/stream/stream.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>
#include <xxhash.h>

#include "lib/stream/layout.h"

#define BLOCK ((size_t)1 << 20)    /* smallest buffer, and the pipe's size */
#define CHUNK BLOCK                /* most bytes of one read(): all that a pipe
                                    * holds, so that reader and writer take
                                    * turns; with less they spin on its lock */
#define RELEASE ((size_t)64 << 20) /* mapped bytes kept after use */

enum source { SOURCE_PIPE, SOURCE_MAP, SOURCE_MEMORY };

/* Bytes begin..end of base are data not yet handed out; the record handed out
 * last starts at begin and takes `held` bytes until the next call. */
struct stream_reader {
    enum source source;
    int fd;
    char *name;
    unsigned char *base;
    size_t begin, end, room, held;
    unsigned char *spare;      /* SOURCE_PIPE, pair: of the record before */
    size_t spare_room;
    size_t released;           /* SOURCE_MAP: pages before this are dropped */
    size_t max_bytes;
    bool trust, pair, ended;
    uint64_t records;          /* read so far */
    uint64_t last_frame;       /* of the last good record */
    XXH3_state_t *hash;
};

static size_t limit = STREAM_MAX_BYTES; /* set once, before any thread */

void stream_set_limit(size_t max_bytes)
{
    limit = max_bytes;
}

size_t stream_limit(void)
{
    return limit;
}

const char *stream_name(const struct stream_reader *r)
{
    return r->name;
}

int stream_blame(const struct stream_reader *r, const struct record *rec,
                 struct error *err)
{
    return error_prefix(err, "%s: frame %llu", r->name,
                        (unsigned long long)rec->frame);
}

int stream_each(struct stream_reader *r, record_sink sink, void *context,
                struct error *err)
{
    struct record rec;
    int rc;

    while ((rc = stream_read(r, &rec, err)) > 0)
        if ((rc = sink(&rec, context, err)))
            return rc < 0 ? stream_blame(r, &rec, err) : rc;
    return rc;
}

int stream_load(const char *path, record_sink sink, void *context,
                struct error *err)
{
    struct stream_reader *r = stream_open(path, NULL, err);
    const int rc = r ? stream_each(r, sink, context, err) : -1;

    stream_close(r);
    return rc;
}

/* Without a source as yet. NULL: no memory. */
static struct stream_reader *reader_new(const char *name,
                                        const struct stream_options *opt,
                                        struct error *err)
{
    struct stream_reader *r = calloc(1, sizeof *r);

    if (r) {
        r->fd = -1;
        r->name = strdup(name);
        r->hash = XXH3_createState();
        r->max_bytes = opt && opt->max_bytes ? opt->max_bytes
                                             : limit;
        r->trust = opt && opt->trust;
        r->pair = opt && opt->pair;
    }
    if (!r || !r->name || !r->hash) {
        stream_close(r);
        return error_null(err, EX_OSERR, "out of memory");
    }
    return r;
}

void stream_close(struct stream_reader *r)
{
    if (!r)
        return;
    if (r->source != SOURCE_MEMORY && r->base)
        munmap(r->base, r->room);
    if (r->spare)
        munmap(r->spare, r->spare_room);
    if (r->fd > STDIN_FILENO)
        close(r->fd);
    XXH3_freeState(r->hash);
    free(r->name);
    free(r);
}

/* Map the rest of a regular file.  0 also when mapping is not possible: the
 * file is then read like a pipe. */
static void reader_map_file(struct stream_reader *r, const struct stat *st)
{
    off_t at = lseek(r->fd, 0, SEEK_CUR);
    void *p;

    if (at < 0 || at % STREAM_ALIGN || at >= st->st_size)
        return;
    p = mmap(NULL, (size_t)st->st_size, PROT_READ, MAP_PRIVATE, r->fd, 0);
    if (p == MAP_FAILED)
        return;
    madvise(p, (size_t)st->st_size, MADV_SEQUENTIAL);
    r->source = SOURCE_MAP;
    r->base = p;
    r->begin = (size_t)at;
    r->end = r->room = (size_t)st->st_size;
}

/* Open the path and decide between mapping and reading. */
static int reader_open_source(struct stream_reader *r, const char *path,
                              struct error *err)
{
    bool standard = strcmp(path, "-") == 0;
    struct stat st;

    r->fd = standard ? STDIN_FILENO : open(path, O_RDONLY | O_CLOEXEC);
    if (r->fd < 0 || fstat(r->fd, &st))
        return error_set(err, EX_NOINPUT, "cannot open: %s", strerror(errno));
    if (S_ISDIR(st.st_mode))
        return error_set(err, EX_NOINPUT, "is a directory (expected a "
                         "stream)");
    if (isatty(r->fd))
        return error_set(err, EX_USAGE, "is a terminal (expected a stream "
                         "from a file or a pipe)");
    if (S_ISREG(st.st_mode))
        reader_map_file(r, &st);
    else if (S_ISFIFO(st.st_mode))
        (void)!fcntl(r->fd, F_SETPIPE_SZ, (int)BLOCK); /* a wish only */
    return 0;
}

bool stream_probe(const char *path)
{
    char magic[sizeof STREAM_MAGIC - 1];
    struct stat st;
    const int fd = stat(path, &st) == 0 && S_ISREG(st.st_mode)
                       ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    const ssize_t n = fd < 0 ? -1 : read(fd, magic, sizeof magic);

    if (fd >= 0)
        close(fd);
    return n == sizeof magic && memcmp(magic, STREAM_MAGIC, sizeof magic) == 0;
}

struct stream_reader *stream_open(const char *path,
                                  const struct stream_options *opt,
                                  struct error *err)
{
    const char *name = strcmp(path, "-") ? path : "<stdin>";
    struct stream_reader *r = reader_new(name, opt, err);

    if (r && reader_open_source(r, path, err)) {
        error_prefix(err, "%s", name);
        stream_close(r);
        r = NULL;
    }
    return r;
}

struct stream_reader *stream_open_memory(const void *data, size_t bytes,
                                         const char *name,
                                         const struct stream_options *opt,
                                         struct error *err)
{
    struct stream_reader *r;

    if ((uintptr_t)data % STREAM_ALIGN)
        return error_null(err, EX_SOFTWARE, "%s: memory is not aligned", name);
    r = reader_new(name, opt, err);
    if (r) {
        r->source = SOURCE_MEMORY;
        r->base = (unsigned char *)(uintptr_t)data; /* is only read */
        r->end = r->room = bytes;
    }
    return r;
}

/* *base with so much room, what it holds kept. */
static int reader_buffer_resize(unsigned char **base, size_t *room, size_t want,
                                struct error *err)
{
    void *p = *base ? mremap(*base, *room, want, MREMAP_MAYMOVE)
                    : mmap(NULL, want, PROT_READ | PROT_WRITE,
                           MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

    if (p == MAP_FAILED)
        return error_set(err, EX_OSERR, "no memory for a record of %zu bytes",
                         want);
    *base = p;
    *room = want;
    if (want > BLOCK)
        madvise(p, want, MADV_HUGEPAGE);
    return 0;
}

/* Make room for need bytes from r->begin on, but never much more than twice
 * what has really arrived: a header's word alone allocates nothing. */
static int reader_make_room(struct stream_reader *r, size_t need,
                            struct error *err)
{
    size_t have = r->end - r->begin;
    size_t room = r->room;

    if (r->begin && (have == 0 || r->begin + need > r->room)) {
        memmove(r->base, r->base + r->begin, have);
        r->begin = 0;
        r->end = have;
    }
    if (r->end < r->room)
        return 0;
    room = room ? 2 * room : BLOCK;
    if (room > layout_align(need) && need > BLOCK)
        room = (need + 4095) & ~(size_t)4095;
    return reader_buffer_resize(&r->base, &r->room, room, err);
}

/* Read some bytes towards need from r->begin on.  1, 0 at the end, -1. */
static int reader_fill(struct stream_reader *r, size_t need, struct error *err)
{
    size_t want;
    ssize_t n;

    if (r->source != SOURCE_PIPE)
        return 0;
    if (reader_make_room(r, need, err))
        return -1;
    want = r->room - r->end;
    if (need > BLOCK && want > need - (r->end - r->begin))
        want = need - (r->end - r->begin); /* large: stop where it ends */
    do
        n = read(r->fd, r->base + r->end, want < CHUNK ? want : CHUNK);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return error_set(err, EX_IOERR, "cannot read: %s", strerror(errno));
    r->end += (size_t)n;
    return n > 0;
}

/* At least need bytes from r->begin on.  1, 0 when the data end before, -1. */
static int reader_ensure(struct stream_reader *r, size_t need,
                         struct error *err)
{
    int rc = 1;

    while (rc > 0 && r->end - r->begin < need)
        rc = reader_fill(r, need, err);
    return rc;
}

/* Read on in the other buffer: the record handed out last stays in this one,
 * and what has arrived behind it moves. */
static int reader_change_buffers(struct stream_reader *r, struct error *err)
{
    size_t left = r->end - r->begin - r->held, room = r->spare_room;
    unsigned char *base = r->spare;
    const unsigned char *from = r->base + r->begin + r->held;

    while (room < left)
        room = room ? 2 * room : BLOCK;
    if (room > r->spare_room &&
        reader_buffer_resize(&base, &r->spare_room, room, err))
        return -1;
    if (left)
        memcpy(base, from, left);
    r->spare = r->base;
    r->spare_room = r->room;
    r->base = base;
    r->room = room;
    r->begin = r->held = 0;
    r->end = left;
    return 0;
}

/* Let go of the record handed out last, or with pair the one before. */
static int reader_advance(struct stream_reader *r, struct error *err)
{
    if (r->pair && r->held && r->source == SOURCE_PIPE)
        return reader_change_buffers(r, err);
    r->begin += r->held;
    r->held = 0;
    if (r->source == SOURCE_MAP && r->begin - r->released >= RELEASE) {
        size_t upto = r->begin & ~(size_t)65535;

        madvise(r->base + r->released, upto - r->released, MADV_DONTNEED);
        r->released = upto;
    }
    return 0;
}

/* The error for a stream that ends inside of something. */
static int reader_cut_short(struct stream_reader *r, const char *what,
                            size_t need, struct error *err)
{
    return error_set(err, EX_DATAERR, "%s cut short: %zu of %zu bytes, the "
                     "writer stopped early", what, r->end - r->begin, need);
}

/* The payload is what the writer wrote. */
static int reader_check_hash(const struct record *rec, uint64_t hash,
                             struct error *err)
{
    if (hash == rec->payload_hash)
        return 0;
    return error_set(err, EX_DATAERR, "frame %llu: %s checksum %016llx does "
                     "not match its payload (%016llx)",
                     (unsigned long long)rec->frame, rec->type,
                     (unsigned long long)rec->payload_hash,
                     (unsigned long long)hash);
}

/* Wait for the payload behind the header at r->begin, hashing what arrives. */
static int reader_read_payload(struct stream_reader *r,
                               const struct record *rec, struct error *err)
{
    size_t need = HEADER_BYTES + rec->payload_bytes, done = HEADER_BYTES;
    int rc = 1;

    XXH3_64bits_reset(r->hash);
    for (;;) {
        size_t have = r->end - r->begin < need ? r->end - r->begin : need;

        if (!r->trust && have > done)
            XXH3_64bits_update(r->hash, r->base + r->begin + done,
                               have - done);
        done = have;
        if (done == need)
            break;
        if ((rc = reader_fill(r, need, err)) < 0)
            return -1;
        if (rc == 0)
            return reader_cut_short(r, rec->type, need, err);
    }
    return reader_check_hash(rec, r->trust ? rec->payload_hash
                                           : XXH3_64bits_digest(r->hash),
                             err);
}

/* END counts the records before it and nothing follows it. */
static int reader_read_end(struct stream_reader *r, const struct record *rec,
                           struct error *err)
{
    int rc;

    if (rec->count || rec->payload_bytes)
        return error_set(err, EX_DATAERR, "END has a payload");
    if (rec->frame != r->records)
        return error_set(err, EX_DATAERR, "END counts %llu records (expected "
                         "%llu)", (unsigned long long)rec->frame,
                         (unsigned long long)r->records);
    rc = reader_ensure(r, HEADER_BYTES + 1, err);
    if (rc > 0)
        return error_set(err, EX_DATAERR, "data follow the END record");
    r->ended = rc == 0;
    return rc;
}

/* Header, table, payload; each is checked before the next is read. */
static int reader_read_record(struct stream_reader *r, struct record *rec,
                              struct error *err)
{
    int rc = reader_ensure(r, HEADER_BYTES, err);
    size_t table;

    if (rc < 0)
        return -1;
    if (rc == 0 && r->end > r->begin)
        return reader_cut_short(r, "header", HEADER_BYTES, err);
    if (rc == 0)
        return r->records
                   ? error_set(err, EX_DATAERR, "no END record, the writer "
                               "stopped early")
                   : error_set(err, EX_DATAERR, "empty input (expected a "
                               "stream)");
    if (layout_get_header(rec, (void *)(r->base + r->begin), r->max_bytes,
                          err))
        return -1;
    table = HEADER_BYTES + (size_t)rec->count * ENTRY_BYTES;
    if (r->source != SOURCE_PIPE &&
        r->end - r->begin - HEADER_BYTES < rec->payload_bytes)
        return reader_cut_short(r, rec->type, HEADER_BYTES + rec->payload_bytes,
                                err);
    if ((rc = reader_ensure(r, table, err)) <= 0)
        return rc ? -1 : reader_cut_short(r, rec->type, table, err);
    if (layout_get_table(rec, (void *)(r->base + r->begin + HEADER_BYTES),
                         err) ||
        reader_read_payload(r, rec, err) ||
        layout_attach(rec, r->base + r->begin + HEADER_BYTES, err))
        return -1;
    if (record_is(rec, RECORD_END))
        return reader_read_end(r, rec, err);
    r->held = HEADER_BYTES + rec->payload_bytes;
    r->last_frame = rec->frame;
    r->records++;
    return 1;
}

int stream_read(struct stream_reader *r, struct record *rec,
                struct error *err)
{
    int rc;

    if (r->ended)
        return 0;
    rc = reader_advance(r, err) ? -1 : reader_read_record(r, rec, err);
    if (rc < 0 && r->records)
        return error_prefix(err, "%s: after frame %llu", r->name,
                            (unsigned long long)r->last_frame);
    return rc < 0 ? error_prefix(err, "%s", r->name) : rc;
}
