/* The record stream: what checking costs beside the checksum alone and beside
 * moving the bytes. */
#include "lib/lab/bench/bench.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>
#include <xxhash.h>

#include "lib/base/file.h"
#include "lib/base/random.h"
#include "lib/stream/schema.h"
#include "lib/stream/stream.h"

/* One kind of record, and the file and the pipe it goes through. */
struct traffic {
    const char *type;
    struct array array[8];
    int arrays, records;       /* of one call */
    size_t bytes;              /* of one record's data */
    float *data;
    char path[FILE_TEMPORARY]; /* a stream of so many records */
    unsigned char *block;
};

enum { BLOCK = 1 << 20 };

/* ---- what is timed ------------------------------------------------------- */

/* Checksums of all records, no input or output. */
static int bench_call_hash(void *context, struct error *err)
{
    struct traffic *t = context;
    uint64_t sum = 0;

    (void)err;
    for (int i = 0; i < t->records; i++) {
        t->block[0] = (unsigned char)i; /* or one call would do for all */
        sum += XXH3_64bits(t->data, t->bytes);
    }
    t->block[1] = (unsigned char)sum;
    return 0;
}

/* Every record, checked as programs check them. */
static int bench_read_all(const char *path, struct error *err)
{
    struct stream_reader *r = stream_open(path, NULL, err);
    struct record rec;
    int rc = -1;

    while (r && (rc = stream_read(r, &rec, err)) > 0)
        if ((rc = schema_check(&rec, err)) ||
            (rc = record_check_finite(&rec, err)))
            break;
    stream_close(r);
    return rc;
}

static int bench_call_file(void *context, struct error *err)
{
    return bench_read_all(((struct traffic *)context)->path, err);
}

/* A child that writes the file's bytes into a pipe, as cat does. */
static int bench_start_cat(const struct traffic *t, pid_t *child,
                           struct error *err)
{
    int fd[2];

    if (pipe(fd) || (*child = fork()) < 0)
        return error_set(err, EX_OSERR, "pipe: %s", strerror(errno));
    if (*child == 0) {
        int in = open(t->path, O_RDONLY);
        ssize_t n;

        close(fd[0]);
        while ((n = read(in, t->block, BLOCK / 8)) > 0)
            if (write(fd[1], t->block, (size_t)n) != n)
                _exit(1);
        _exit(0);
    }
    close(fd[1]);
    return fd[0];
}

/* End the other end of the pipe; rc is passed on. */
static int bench_finish_cat(int fd, pid_t child, int rc)
{
    int status;

    close(fd);
    waitpid(child, &status, 0);
    return rc;
}

/* Read it all again, through a pipe. */
static int bench_call_pipe(void *context, struct error *err)
{
    char path[32];
    pid_t child;
    int fd = bench_start_cat(context, &child, err);

    if (fd < 0)
        return -1;
    snprintf(path, sizeof path, "/dev/fd/%d", fd);
    return bench_finish_cat(fd, child, bench_read_all(path, err));
}

/* What the pipe costs by itself: bytes are read and forgotten. */
static int bench_call_count(void *context, struct error *err)
{
    struct traffic *t = context;
    pid_t child;
    int fd = bench_start_cat(t, &child, err);

    if (fd < 0)
        return -1;
    while (read(fd, t->block, BLOCK / 8) > 0)
        ;
    return bench_finish_cat(fd, child, 0);
}

/* Records written to nowhere. */
static int bench_call_write(void *context, struct error *err)
{
    const struct traffic *t = context;
    struct stream_writer *w = stream_create("/dev/null", err);
    int rc = w ? 0 : -1;

    for (int i = 0; w && i < t->records && rc == 0; i++)
        rc = stream_write(w, t->type, (uint64_t)i, 0, t->array, t->arrays,
                          err);
    if (rc) {
        stream_abandon(w);
        return -1;
    }
    return stream_finish(w, err);
}

/* ---- the two kinds of traffic -------------------------------------------- */

static void bench_add_array(struct traffic *t, const char *name, int ndim,
                            size_t d0, size_t d1)
{
    struct array a = array_make(name, DTYPE_F32,
                                t->data + t->bytes / sizeof(float), ndim, d0,
                                d1, 0, 0);

    t->array[t->arrays++] = a;
    t->bytes += array_bytes(&a);
}

/* An avatar of the paper's size, eight times over. */
static void bench_make_gaussians(struct traffic *t)
{
    enum { N = 108658 };

    t->type = RECORD_GAUS;
    t->records = 8;
    bench_add_array(t, "mean", 2, N, 3);
    bench_add_array(t, "scale", 2, N, 3);
    bench_add_array(t, "quat", 2, N, 4);
    bench_add_array(t, "opacity", 1, N, 0);
    bench_add_array(t, "color", 2, N, 32);
}

static void bench_make_motion(struct traffic *t)
{
    t->type = RECORD_MOTN;
    t->records = 2000;
    bench_add_array(t, "rot", 2, 3, 3);
    bench_add_array(t, "trans", 1, 3, 0);
    bench_add_array(t, "exp", 1, 100, 0);
    bench_add_array(t, "jaw", 1, 3, 0);
    bench_add_array(t, "lid", 1, 2, 0);
    bench_add_array(t, "eye", 1, 6, 0);
}

/* The traffic as a stream in a temporary file. */
static int bench_write_file(struct traffic *t, struct error *err)
{
    struct stream_writer *w;
    int fd;

    file_temporary(t->path, "spid-bench-XXXXXX");
    fd = mkstemp(t->path);
    if (fd < 0)
        return error_set(err, EX_CANTCREAT, "%s: %s", t->path,
                         strerror(errno));
    close(fd);
    w = stream_create(t->path, err);
    for (int i = 0; w && i < t->records; i++)
        if (stream_write(w, t->type, (uint64_t)i, 0, t->array, t->arrays,
                         err)) {
            stream_abandon(w);
            return -1;
        }
    return w ? stream_finish(w, err) : -1;
}

/* Each way of moving the traffic, timed. */
static int bench_add_rows(struct bench *b, struct traffic *t, struct error *err)
{
    static const struct {
        const char *knob;
        int (*call)(void *context, struct error *err);
    } calls[] = { { "checksum alone", bench_call_hash },
                  { "read and check, file", bench_call_file },
                  { "read and check, pipe", bench_call_pipe },
                  { "only count bytes, pipe", bench_call_count },
                  { "write to /dev/null", bench_call_write } };
    char config[96];

    snprintf(config, sizeof config, "%s %.1f kB, ms a record", t->type,
             (double)t->bytes / 1000);
    for (size_t i = 0; i < sizeof calls / sizeof *calls; i++) {
        struct bench_times m;

        if (bench_time(&m, b->seconds / 12, 3, calls[i].call, t, err))
            return -1;
        m.min /= t->records;
        m.median /= t->records;
        m.p95 /= t->records;
        if (!bench_add(b, "stream", config, calls[i].knob, 1, &m, NAN, NAN))
            return error_set(err, EX_OSERR, "out of memory");
        bench_note(b, "stream: %s, %s: %.2f GB/s", t->type, calls[i].knob,
                   (double)t->bytes / m.min * 1e-6);
    }
    return 0;
}

int bench_stream(struct bench *b, struct error *err)
{
    static void (*const kinds[])(struct traffic *) = { bench_make_gaussians,
                                                       bench_make_motion };
    int rc = 0;

    for (size_t k = 0; k < 2 && rc == 0; k++) {
        struct traffic t = { 0 };
        struct random r;

        kinds[k](&t);          /* once for the size, once for the places */
        t.data = malloc(t.bytes);
        t.block = malloc(BLOCK);
        rc = t.data && t.block ? 0 : error_set(err, EX_OSERR, "no memory");
        random_init(&r, 1, "bench_stream");
        for (size_t i = 0; rc == 0 && i < t.bytes / sizeof(float); i++)
            t.data[i] = (float)random_uniform(&r);
        t.bytes = 0;
        t.arrays = 0;
        if (rc == 0) {
            kinds[k](&t);
            rc = bench_write_file(&t, err) || bench_add_rows(b, &t, err) ? -1
                                                                         : 0;
        }
        if (t.path[0])
            unlink(t.path);
        free(t.data);
        free(t.block);
    }
    return rc;
}
