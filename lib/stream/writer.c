/* Writing records: one writev per record, nothing kept back. */
#include "lib/stream/stream.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <sysexits.h>
#include <unistd.h>
#include <xxhash.h>

#include "lib/stream/layout.h"

#define PIPE_BYTES (1 << 20)
#define PIECES (2 + 2 * STREAM_MAX_ARRAYS) /* of a record, parts apart */

static const unsigned char zeros[STREAM_ALIGN];

struct stream_writer {
    int fd;
    char *name;                /* for messages */
    char *path, *part;         /* NULL unless a regular file is written */
    bool failed;
    uint64_t records;
    XXH3_state_t *hash;
    struct layout_entry table[STREAM_MAX_ARRAYS];
    struct iovec *iov;         /* pieces of a record */
    size_t iov_room;
};

/* Close and free; what was written stays. */
static void writer_free(struct stream_writer *w)
{
    if (!w)
        return;
    if (w->fd > STDERR_FILENO)
        close(w->fd);
    XXH3_freeState(w->hash);
    free(w->iov);
    free(w->name);
    free(w->path);
    free(w->part);
    free(w);
}

/* Open the file for writing: a regular (or new) one as PATH.part, anything
 * else (a fifo, /dev/null) as it is. */
static int writer_open_file(struct stream_writer *w, const char *path,
                            struct error *err)
{
    struct stat st;
    bool special = stat(path, &st) == 0 && !S_ISREG(st.st_mode);
    int flags = O_WRONLY | O_CLOEXEC | (special ? 0 : O_CREAT | O_TRUNC);

    if (special && S_ISDIR(st.st_mode))
        return error_set(err, EX_CANTCREAT, "is a directory");
    if (!special) {
        w->path = strdup(path);
        if (!w->path || asprintf(&w->part, "%s.part", path) < 0) {
            w->part = NULL;
            return error_set(err, EX_OSERR, "out of memory");
        }
    }
    w->fd = open(special ? path : w->part, flags, 0666);
    if (w->fd < 0)
        return error_set(err, EX_CANTCREAT, "cannot create: %s",
                         strerror(errno));
    return 0;
}

struct stream_writer *stream_create(const char *path, struct error *err)
{
    bool standard = strcmp(path, "-") == 0;
    const char *name = standard ? "<stdout>" : path;
    struct stream_writer *w = calloc(1, sizeof *w);

    if (w) {
        w->fd = STDOUT_FILENO;
        w->name = strdup(name);
        w->hash = XXH3_createState();
    }
    if (!w || !w->name || !w->hash) {
        error_set(err, EX_OSERR, "out of memory");
        goto fail;
    }
    if (!standard && writer_open_file(w, path, err))
        goto fail;
    if (isatty(w->fd)) {
        error_set(err, EX_USAGE, "will not write binary records to a "
                  "terminal (use a pipe or -o FILE)");
        goto fail;
    }
    (void)!fcntl(w->fd, F_SETPIPE_SZ, PIPE_BYTES); /* fails if no pipe */
    return w;

fail:
    error_prefix(err, "%s", name);
    writer_free(w);
    return NULL;
}

/* Write all pieces; iov is used up. */
static int writer_write_pieces(struct stream_writer *w, struct iovec *iov,
                               size_t count, struct error *err)
{
    while (count > 0) {
        ssize_t n = writev(w->fd, iov, count < IOV_MAX ? (int)count
                                                       : IOV_MAX);

        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0) {
            w->failed = true;
            return error_set(err, EX_IOERR, "%s: cannot write: %s", w->name,
                             strerror(errno));
        }
        while (count > 0 && (size_t)n >= iov->iov_len) {
            n -= (ssize_t)iov->iov_len;
            iov++;
            count--;
        }
        if (count > 0) {
            iov->iov_base = (char *)iov->iov_base + n;
            iov->iov_len -= (size_t)n;
        }
    }
    w->records++;
    return 0;
}

/* writev wants pointers to non-const; it only reads. */
static struct iovec writer_iov_piece(const void *data, size_t bytes)
{
    struct iovec v = { (void *)(uintptr_t)data, bytes };

    return v;
}

/* Room for so many pieces. */
static int writer_room(struct stream_writer *w, size_t pieces,
                       struct error *err)
{
    struct iovec *p;

    if (pieces <= w->iov_room)
        return 0;
    p = realloc(w->iov, 2 * pieces * sizeof *p);
    if (!p)
        return error_set(err, EX_OSERR, "%s: no memory for %zu parts",
                         w->name, pieces);
    w->iov = p;
    w->iov_room = 2 * pieces;
    return 0;
}

/* Sum of their lengths. */
static size_t writer_parts_bytes(const struct iovec *part, size_t parts)
{
    size_t sum = 0;

    for (size_t i = 0; i < parts; i++)
        sum += part[i].iov_len;
    return sum;
}

/* The payload's pieces behind w->iov[0], which is the header's; how many there
 * are with it. */
static size_t writer_collect(struct stream_writer *w,
                             const struct array *arrays, int count,
                             const struct iovec *part, size_t parts)
{
    struct iovec *iov = w->iov;
    size_t n = 1;

    iov[n++] = writer_iov_piece(w->table, (size_t)count * ENTRY_BYTES);
    for (int i = 0; i < count; i++) {
        size_t bytes = (size_t)w->table[i].bytes;

        if (i == 0 && part) {
            memcpy(iov + n, part, parts * sizeof *iov);
            n += parts;
        } else if (bytes) {
            iov[n++] = writer_iov_piece(arrays[i].data, bytes);
        }
        if (bytes % STREAM_ALIGN)
            iov[n++] = writer_iov_piece(zeros,
                                        STREAM_ALIGN - bytes % STREAM_ALIGN);
    }
    return n;
}

int stream_write_parts(struct stream_writer *w, const char *type,
                       uint64_t frame, double time,
                       const struct array *arrays, int count,
                       const struct iovec *part, size_t parts,
                       struct error *err)
{
    struct layout_header header;
    size_t payload, n;

    if (count < 0 || count > STREAM_MAX_ARRAYS || strlen(type) != 4)
        return error_set(err, EX_SOFTWARE, "%s: record '%s' of %d arrays (at "
                         "most %d)", w->name, type, count, STREAM_MAX_ARRAYS);
    if (layout_put_table(w->table, &payload, arrays, count, err))
        return error_prefix(err, "%s: frame %llu: %s", w->name,
                            (unsigned long long)frame, type);
    if (part &&
        (count == 0 || writer_parts_bytes(part, parts) != w->table[0].bytes))
        return error_set(err, EX_SOFTWARE, "%s: record '%s': parts of another "
                         "length than its first array", w->name, type);
    if (writer_room(w, PIECES + parts, err))
        return -1;
    n = writer_collect(w, arrays, count, part, parts);
    XXH3_64bits_reset(w->hash);
    for (size_t i = 1; i < n; i++)
        XXH3_64bits_update(w->hash, w->iov[i].iov_base, w->iov[i].iov_len);
    layout_put_header(&header, type, frame, time, count, payload,
                      XXH3_64bits_digest(w->hash));
    w->iov[0] = writer_iov_piece(&header, sizeof header);
    return writer_write_pieces(w, w->iov, n, err);
}

int stream_write(struct stream_writer *w, const char *type, uint64_t frame,
                 double time, const struct array *arrays, int count,
                 struct error *err)
{
    return stream_write_parts(w, type, frame, time, arrays, count, NULL, 0,
                              err);
}

int stream_copy(struct stream_writer *w, const struct record *rec,
                struct error *err)
{
    struct layout_header header;
    struct iovec iov[2];

    if (!rec->payload)
        return stream_write(w, rec->type, rec->frame, rec->time, rec->array,
                            rec->count, err);
    layout_put_header(&header, rec->type, rec->frame, rec->time, rec->count,
                      rec->payload_bytes, rec->payload_hash);
    iov[0] = writer_iov_piece(&header, sizeof header);
    iov[1] = writer_iov_piece(rec->payload, rec->payload_bytes);
    return writer_write_pieces(w, iov, 2, err);
}

int stream_finish(struct stream_writer *w, struct error *err)
{
    int rc = stream_write(w, RECORD_END, w->records, 0, NULL, 0, err);
    int fd = w->fd;

    if (rc) {
        stream_abandon(w);
        return -1;
    }
    w->fd = -1;
    if (close(fd))
        rc = error_set(err, EX_IOERR, "%s: cannot close: %s", w->name,
                       strerror(errno));
    else if (w->part && rename(w->part, w->path))
        rc = error_set(err, EX_CANTCREAT, "%s: cannot rename %s: %s", w->name,
                       w->part, strerror(errno));
    writer_free(w);
    return rc;
}

void stream_abandon(struct stream_writer *w)
{
    struct stat st;

    if (!w)
        return;
    if (w->part && fstat(w->fd, &st) == 0 && st.st_size == 0)
        unlink(w->part);
    writer_free(w);
}
