/* Damaged streams: cut at every byte, every bit flipped, and headers that are
 * lies with their checksums made right.  Nothing may pass or crash, and a
 * large claim must not allocate. */
#include "lib/stream/stream.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>
#include <xxhash.h>

#include "lib/base/random.h"
#include "lib/stream/layout.h"
#include "tests/check.h"

static struct error err;
static unsigned char *good, *bad;
static size_t size, starts[8]; /* of the stream; of each record */

/* CONF, two records with arrays of several kinds, one without, END. */
static void make_stream(void)
{
    char path[] = "/tmp/spid-damage-XXXXXX";
    static const float x[5] = { 1, 2, 3, 4, 5 };
    static const unsigned char b[70] = { 7 };
    struct array a[] = { array_make("x", DTYPE_F32, x, 1, 5, 0, 0, 0),
                         array_make("byte", DTYPE_U8, b, 2, 7, 10, 0, 0),
                         array_make("none", DTYPE_F64, x, 2, 0, 3, 0, 0),
                         array_make("half", DTYPE_F16, x, 0, 0, 0, 0, 0) };
    int fd = mkstemp(path);
    struct stream_writer *w = stream_create(path, &err);

    REQUIRE(fd >= 0 && w, "%s", err.text);
    REQUIRE(!stream_write(w, "CONF", 0, 0, a + 1, 1, &err), "%s", err.text);
    REQUIRE(!stream_write(w, "TEST", 3, 0.1, a, 4, &err), "%s", err.text);
    REQUIRE(!stream_write(w, "NONE", 4, 0.2, NULL, 0, &err), "%s", err.text);
    REQUIRE(!stream_write(w, "TEST", 5, 0.3, a, 3, &err), "%s", err.text);
    REQUIRE(!stream_finish(w, &err), "%s", err.text);
    close(fd);
    fd = open(path, O_RDONLY);
    size = (size_t)lseek(fd, 0, SEEK_END);
    good = aligned_alloc(64, size);
    bad = aligned_alloc(64, size);
    REQUIRE(good && bad && pread(fd, good, size, 0) == (ssize_t)size, "%s",
            err.text);
    close(fd);
    unlink(path);
    for (size_t at = 0, i = 0; at < size; i++) {
        struct layout_header h;

        starts[i] = at;
        memcpy(&h, good + at, sizeof h);
        at += 64 + h.payload_bytes;
    }
}

/* Records before the reader stops; *rc is its last result. */
static int read_all(struct stream_reader *r, int *rc)
{
    struct record rec;
    int n = 0;

    REQUIRE(r, "%s", err.text);
    while ((*rc = stream_read(r, &rec, &err)) > 0)
        n++;
    stream_close(r);
    return n;
}

static int read_memory(const unsigned char *data, size_t bytes, int *rc)
{
    return read_all(stream_open_memory(data, bytes, "m", NULL, &err), rc);
}

/* The same bytes through a pipe (they fit into it). */
static int read_pipe(const unsigned char *data, size_t bytes, int *rc)
{
    char path[40];
    int fd[2], n;

    REQUIRE(pipe(fd) == 0, "%s", err.text);
    REQUIRE(write(fd[1], data, bytes) == (ssize_t)bytes, "%s", err.text);
    close(fd[1]);
    snprintf(path, sizeof path, "/dev/fd/%d", fd[0]);
    n = read_all(stream_open(path, NULL, &err), rc);
    close(fd[0]);
    return n;
}

static void test_truncation(void)
{
    unsigned char *part;
    int rc, whole;

    for (size_t n = 0; n < size; n++) {
        whole = 0;
        while (whole < 4 && starts[whole + 1] <= n)
            whole++;
        part = aligned_alloc(64, (n + 64) / 64 * 64); /* its own block */
        REQUIRE(part, "%s", err.text);
        memcpy(part, good, n);
        REQUIRE(read_memory(part, n, &rc) == whole && rc == -1, "%s",
                err.text);
        REQUIRE(err.code == EX_DATAERR, "%s", err.text);
        REQUIRE(read_pipe(part, n, &rc) == whole && rc == -1, "%s", err.text);
        REQUIRE(err.code == EX_DATAERR, "%s", err.text);
        REQUIRE(!whole == !strstr(err.text, "after frame"), "%s", err.text);
        free(part);
    }
    REQUIRE(read_memory(good, size, &rc) == 4 && rc == 0, "%s", err.text);
    REQUIRE(read_pipe(good, size, &rc) == 4 && rc == 0, "%s", err.text);
    printf("cut at each of %zu bytes: found, good records kept\n", size);
}

static void test_bit_flips(void)
{
    int rc;

    memcpy(bad, good, size);
    for (size_t bit = 0; bit < 8 * size; bit++) {
        bad[bit / 8] ^= (unsigned char)(1 << bit % 8);
        read_memory(bad, size, &rc);
        REQUIRE(rc == -1 && err.code == EX_DATAERR, "%s", err.text);
        if (bit % 17 == 0) {
            read_pipe(bad, size, &rc);
            REQUIRE(rc == -1 && err.code == EX_DATAERR, "%s", err.text);
        }
        bad[bit / 8] ^= (unsigned char)(1 << bit % 8);
    }
    printf("each of %zu bits flipped: found\n", 8 * size);
}

/* Make the checksums of the record at `at` right again. */
static void damage_rehash(size_t at)
{
    struct layout_header h;

    memcpy(&h, bad + at, sizeof h);
    if (h.payload_bytes <= size - at - 64)
        h.payload_hash = XXH3_64bits(bad + at + 64, h.payload_bytes);
    h.check = XXH3_64bits(&h, HEADER_HASHED);
    memcpy(bad + at, &h, sizeof h);
}

/* Put value into record 1 (+ the place of a field) and expect `text`. */
static void damage_lie(size_t offset, uint64_t value, size_t bytes,
                       const char *text)
{
    int rc, n;

    memcpy(bad, good, size);
    memcpy(bad + starts[1] + offset, &value, bytes);
    damage_rehash(starts[1]);
    n = read_memory(bad, size, &rc);
    REQUIRE(rc == -1 && n == 1, "%s", err.text);
    REQUIRE(strstr(err.text, text), "%s", err.text);
    n = read_pipe(bad, size, &rc);
    REQUIRE(rc == -1 && n == 1, "%s", err.text);
    REQUIRE(strstr(err.text, text), "%s", err.text);
}

static void test_lies(void)
{
    const size_t entry = 64;   /* the first one; byte is the next */
    int rc;

    damage_lie(0, 0x44434241, 4, "starts with 'ABCD'");
    damage_lie(4, 2, 2, "format version 2 (expected 1)");
    damage_lie(6, 128, 2, "header of 128 bytes");
    damage_lie(8, 0x01414141, 4, "record type 'AAA?'");
    damage_lie(12, 0xffffffff, 4, "4294967295 arrays (at most 64)");
    damage_lie(12, 5, 4, "");
    damage_lie(24, 0x7ff0000000000000, 8, "time is not finite");
    damage_lie(32, (uint64_t)1 << 60, 8, "1152921504606846976 bytes (at most");
    damage_lie(32, 0xffffffffffffffff, 8,
               "18446744073709551615 bytes (at most");
    damage_lie(32, (uint64_t)1 << 29, 8, "TEST");
    damage_lie(32, 64, 8, "cannot hold 4 arrays");
    damage_lie(32, 383, 8, "cannot hold");
    damage_lie(entry, 0, 8, "name");
    damage_lie(entry + 24, 5, 4, "dtype 5");
    damage_lie(entry + 28, 5, 4, "5 dimensions");
    damage_lie(entry + 28, 0xffffffff, 4, "4294967295 dimensions");
    damage_lie(entry + 32, 6, 4, "does not fit");
    damage_lie(entry + 32, 0xffffffff, 4, "does not fit");
    damage_lie(entry + 36, 1, 4, "(expected 0)");
    damage_lie(entry + 48, 0, 8, "offset 0");
    damage_lie(entry + 48, 0xffffffffffffffc0, 8, "offset");
    damage_lie(entry + 56, 24, 8, "does not fit");
    damage_lie(entry + 56, 0xffffffffffffffff, 8, "does not fit");
    damage_lie(2 * entry, 'x', 8, "two arrays 'x'");
    damage_lie(2 * entry + 32, 0x8000000080000000, 8, "does not fit");
    damage_lie(4 * entry + 64 + 21, 1, 1, "padding after x");

    /* A newer version is told from damage. */
    memcpy(bad, good, size);
    bad[starts[1] + 4] = 2;
    damage_rehash(starts[1]);
    read_memory(bad, size, &rc);
    REQUIRE(rc == -1 && strstr(err.text, "after frame 0: format version 2"),
            "%s", err.text);

    /* A record lost, and something behind END. */
    memcpy(bad, good, starts[2]);
    memcpy(bad + starts[2], good + starts[3], size - starts[3]);
    REQUIRE(read_memory(bad, size - (starts[3] - starts[2]), &rc) == 3, "%s",
            err.text);
    REQUIRE(rc == -1 && strstr(err.text, "END counts 4 records"), "%s",
            err.text);
    unsigned char *more = aligned_alloc(64, 2 * size);
    REQUIRE(more, "%s", err.text);
    memcpy(more, good, size);
    memcpy(more + size, good, size);
    REQUIRE(read_memory(more, 2 * size, &rc) == 4 && rc == -1, "%s", err.text);
    REQUIRE(strstr(err.text, "data follow the END record"), "%s", err.text);
    free(more);
    printf("27 lies with right checksums: found\n");
}

/* Peak of the address space in kB. */
static long damage_peak(void)
{
    char line[200];
    long kb = 0;
    FILE *f = fopen("/proc/self/status", "r");

    while (f && fgets(line, sizeof line, f))
        sscanf(line, "VmPeak: %ld", &kb);
    if (f)
        fclose(f);
    return kb;
}

static void test_allocation(void)
{
    struct layout_header h;
    long before;
    int rc;

    read_pipe(good, size, &rc);
    before = damage_peak();
    memcpy(bad, good, size);
    memcpy(&h, bad, sizeof h);
    h.payload_bytes = STREAM_MAX_BYTES;
    memcpy(bad, &h, sizeof h);
    damage_rehash(0);
    /* Its table must not be consistent with that, and it is read first. */
    read_pipe(bad, size, &rc);
    REQUIRE(rc == -1, "%s", err.text);
    /* Now a table that is: one array of a gigabyte less 64 bytes. */
    struct layout_entry e = { .name = "big", .ndim = 1, .offset = 64,
                              .dim = { (1u << 30) - 64 },
                              .bytes = (1u << 30) - 64 };
    h.count = 1;
    memcpy(bad, &h, sizeof h);
    memcpy(bad + 64, &e, sizeof e);
    damage_rehash(0);
    read_pipe(bad, size, &rc);
    REQUIRE(rc == -1 && strstr(err.text, "cut short"), "%s", err.text);
    REQUIRE(damage_peak() - before < 4096, "%s", err.text);
    printf("a claim of 1 GiB: %ld kB allocated\n", damage_peak() - before);
}

/* Random bytes anywhere, checksums right: an answer, never a crash. */
static void test_random(void)
{
    struct random r;
    int rc, passed = 0;

    random_init(&r, 1, "stream_damage");
    for (int i = 0; i < 30000; i++) {
        size_t at = starts[random_below(&r, 5)];

        memcpy(bad, good, size);
        for (uint32_t k = random_below(&r, 4) + 1; k; k--)
            bad[at + random_below(&r, at + 384 <= size ? 384 : 64)] =
                (unsigned char)random_u64(&r);
        damage_rehash(at);
        read_memory(bad, size, &rc);
        passed += rc == 0;
    }
    printf("30000 random damages with right checksums: %d read as data\n",
           passed);
}

int main(void)
{
    make_stream();
    test_truncation();
    test_bit_flips();
    test_lies();
    test_allocation();
    test_random();
    free(good);
    free(bad);
    return 0;
}
