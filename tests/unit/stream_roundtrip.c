/* What is written is read back, from memory, a file and a pipe. */
#include "lib/stream/ahead.h"
#include "tests/check.h"
#include "tests/folder.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#define RECORDS 5
#define BIG 3000001            /* bytes of the large array: odd on purpose */

#define PART 1000              /* bytes of it written at a time */

static unsigned char *big;
static float mean[20][3];
static int32_t one = -7;
static double half = 0.5;
static struct error err;

/* The first array in more parts than one call of the system takes. */
static void write_parts(struct stream_writer *w, uint64_t f,
                        const struct array *a, int count)
{
    static struct iovec part[BIG / PART + 1];
    size_t n = 0, bytes = array_bytes(a);

    for (size_t at = 0; at < bytes; at += PART, n++)
        part[n] = (struct iovec){big + at, bytes - at < PART ? bytes - at
                                                             : PART};
    REQUIRE(stream_write_parts(w, "GAUS", f, (double)f / 30, a, count, part,
                               n - 1, &err) == -1,
            "%s", err.text);
    REQUIRE(stream_write_parts(w, "GAUS", f, (double)f / 30, a, count, part,
                               n, &err) == 0,
            "%s", err.text);
}

static void write_all(const char *path)
{
    struct stream_writer *w = stream_create(path, &err);

    REQUIRE(w, "%s", err.text);
    for (uint64_t f = 0; f < RECORDS; f++) {
        struct array a[] = {
            array_make("big", DTYPE_U8, big, 1, f == 3 ? BIG : f, 0, 0, 0),
            array_make("mean", DTYPE_F32, mean, 2, 20, 3, 0, 0),
            array_make("one", DTYPE_I32, &one, 1, 1, 0, 0, 0),
            array_make("scalar", DTYPE_F64, &half, 0, 0, 0, 0, 0),
        };

        if (f % 2)
            write_parts(w, f, a, 4);
        else
            REQUIRE(stream_write(w, f == 2 ? "WHAT" : "GAUS", f,
                                 (double)f / 30, a, 4, &err) == 0,
                    "%s", err.text);
    }
    REQUIRE(stream_finish(w, &err) == 0, "%s", err.text);
}

static void check_record(const struct record *rec, uint64_t f)
{
    static const size_t any[2] = { 0, 3 };
    const struct array *a;

    REQUIRE(record_is(rec, f == 2 ? "WHAT" : "GAUS"), "%s", err.text);
    REQUIRE(rec->frame == f && rec->time == (double)f / 30 && rec->count == 4,
            "%s", err.text);
    const float *m = record_get(rec, "mean", DTYPE_F32, 2, any, &err);
    REQUIRE(m && memcmp(m, mean, sizeof mean) == 0, "%s", err.text);
    REQUIRE((uintptr_t)m % STREAM_ALIGN == 0, "%s", err.text);
    a = record_find(rec, "big");
    REQUIRE(a && a->dim[0] == (f == 3 ? BIG : f), "%s", err.text);
    REQUIRE(memcmp(a->data, big, a->dim[0]) == 0, "%s", err.text);
    a = record_find(rec, "scalar");
    REQUIRE(a && a->ndim == 0 && memcmp(a->data, &half, sizeof half) == 0,
            "%s", err.text);
    REQUIRE(!record_find(rec, "none"), "%s", err.text);
    REQUIRE(!record_get(rec, "mean", DTYPE_F64, 2, any, &err), "%s", err.text);
    REQUIRE(record_check_finite(rec, &err) == 0, "%s", err.text);
}

static void read_all(struct stream_reader *r, const char *copy)
{
    struct stream_writer *w = NULL;
    struct record rec;
    uint64_t f = 0;
    int rc;

    REQUIRE(r, "%s", err.text);
    if (copy)
        REQUIRE((w = stream_create(copy, &err)), "%s", err.text);
    while ((rc = stream_read(r, &rec, &err)) > 0) {
        check_record(&rec, f++);
        if (w)
            REQUIRE(stream_copy(w, &rec, &err) == 0, "%s", err.text);
    }
    REQUIRE(rc == 0 && f == RECORDS, "%s", err.text);
    REQUIRE(stream_read(r, &rec, &err) == 0, "%s", err.text);
    if (w)
        REQUIRE(stream_finish(w, &err) == 0, "%s", err.text);
    stream_close(r);
}

/* The same by a thread: a record stays while the next one is read. */
static void read_ahead(const char *path)
{
    struct stream_options opt = { .pair = true };
    struct stream_reader *r = stream_open(path, &opt, &err);
    const struct record *rec;
    uint64_t f = 0;
    int rc;

    REQUIRE(r, "%s", err.text);
    struct ahead *a = ahead_open(r, &err);
    REQUIRE(a, "%s", err.text);
    while ((rc = ahead_read(a, &rec, &err)) > 0) {
        usleep(1000);
        check_record(rec, f++);
    }
    REQUIRE(rc == 0 && f == RECORDS, "%s", err.text);
    REQUIRE(ahead_read(a, &rec, &err) == 0, "%s", err.text);
    ahead_close(a);
    stream_close(r);
}

static void write_fifo(const char *path, bool ahead)
{
    pid_t child = fork();
    int status;

    REQUIRE(child >= 0, "%s", err.text);
    if (child == 0) {
        write_all(path);
        _exit(0);
    }
    if (ahead)
        read_ahead(path);
    else
        read_all(stream_open(path, NULL, &err), NULL);
    REQUIRE(waitpid(child, &status, 0) == child && status == 0, "%s",
            err.text);
}

static unsigned char *roundtrip_slurp(const char *path, size_t *bytes)
{
    struct stat st;
    unsigned char *p;
    FILE *f = fopen(path, "rb");

    REQUIRE(f && stat(path, &st) == 0, "%s", err.text);
    *bytes = (size_t)st.st_size;
    p = aligned_alloc(64, (*bytes + 63) / 64 * 64);
    REQUIRE(p && fread(p, 1, *bytes, f) == *bytes, "%s", err.text);
    fclose(f);
    return p;
}

int main(void)
{
    const char *a, *b;
    size_t na, nb;

    folder_make();
    a = folder_at("a");
    b = folder_at("b");
    big = malloc(BIG);
    REQUIRE(big, "out of memory");
    for (size_t i = 0; i < BIG; i++)
        big[i] = (unsigned char)(i * i >> 7);
    for (int i = 0; i < 60; i++)
        mean[i / 3][i % 3] = (float)i - 30.5f;

    write_all(a);
    REQUIRE(access(folder_at("a.part"), F_OK) != 0, "a.part stays");
    read_all(stream_open(a, NULL, &err), b);     /* mapped */
    unsigned char *pa = roundtrip_slurp(a, &na), *pb = roundtrip_slurp(b, &nb);
    REQUIRE(na == nb && memcmp(pa, pb, na) == 0, "%s", err.text);
    printf("file and copy: %zu bytes, same\n", na);
    read_all(stream_open_memory(pa, na, "memory", NULL, &err), NULL);

    /* Through a fifo, so that the pipe path is taken. */
    b = folder_at("fifo");
    REQUIRE(mkfifo(b, 0600) == 0, "%s", err.text);
    write_fifo(b, false);
    write_fifo(b, true);
    read_ahead(a);
    printf("memory and pipe: same\n");

    free(pa);
    free(pb);
    free(big);
    return folder_remove() || check_status();
}
