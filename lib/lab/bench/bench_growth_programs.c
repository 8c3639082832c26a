/* Growth of whole programs, in the processor time and memory of a run:
 * spid-flame over frames, spid-animate over the people of a list, spid-dump
 * over the bytes of a stream. */
#include "lib/lab/bench/bench_growth.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/file.h"
#include "lib/lab/bench/bench_process.h"
#include "lib/head/motion.h"
#include "lib/stream/hash.h"
#include "lib/stream/layout.h"

#define ROOM (FILE_TEMPORARY + 32)
#define CHUNK ((size_t)64 << 20)        /* bytes of a record that is a hole */

/* A folder for what the programs read, removed with all in it. */
struct room {
    struct bench *b;
    char dir[FILE_TEMPORARY], threads[16];
};

static int growth_room_open(struct room *r, struct bench *b, struct error *err)
{
    r->b = b;
    snprintf(r->threads, sizeof r->threads, "%d", b->threads);
    file_temporary(r->dir, "spid-bench-XXXXXX");
    return mkdtemp(r->dir) ? 0
               : error_set(err, EX_CANTCREAT, "%s: %s", r->dir,
                           strerror(errno));
}

/* path [ROOM] of a name in it. */
static const char *growth_room_at(char *path, const struct room *r,
                                  const char *name)
{
    snprintf(path, ROOM, "%s/%s", r->dir, name);
    return path;
}

static void growth_room_close(struct room *r)
{
    const char *const args[] = {"rm", "-rf", r->dir, NULL};

    process_run(args, -1, NULL, NULL);
}

/* What a program used in one run, as a point of the curve. */
static int growth_add_program(struct growth *g, double x,
                              const struct process_cost *cost,
                              struct error *err)
{
    const double ms = 1e3 * cost->seconds;
    const struct bench_times t = {1, ms, ms, ms};

    return growth_add(g, x, &t, cost->peak, g->b->threads, err);
}

/* A program run: a point. */
static int growth_add_point(struct growth *g, double x, const char *const *args,
                            struct error *err)
{
    struct process_cost cost;

    return process_run(args, -1, &cost, err) ||
           growth_add_program(g, x, &cost, err) ? -1 : 0;
}

/* ---- frames -------------------------------------------------------------- */

/* n motions into a pipe's end, which is closed. */
static int growth_frames_feed(int fd, size_t n, struct error *err)
{
    struct motion m = {.R = {1, 0, 0, 0, -1, 0, 0, 0, -1}, .t = {0, 0, 12}};
    char path[32];
    int rc = 0;

    snprintf(path, sizeof path, "/dev/fd/%d", fd);
    struct stream_writer *w = stream_create(path, err);
    close(fd);
    if (!w)
        return -1;
    m.pose.exp = m.exp;
    for (size_t i = 0; rc == 0 && i < n; i++) {
        m.exp[0] = (float)(i % 100) / 100;
        rc = motion_write(w, i, (double)i / 25, &m, 100, NULL, 0, err);
    }
    if (rc == 0)
        return stream_finish(w, err);
    stream_abandon(w);
    return -1;
}

/* spid-flame on a pipe of n frames. */
static int growth_frames_point(struct growth *g, const struct room *r,
                               const char *program, size_t n, struct error *err)
{
    const char *const args[] = {program, "-q", "-j", r->threads, "--head",
                                g->b->head, "-o", "/dev/null", NULL};
    struct process_cost cost;
    int fd[2];

    if (pipe2(fd, O_CLOEXEC))
        return error_set(err, EX_OSERR, "pipe: %s", strerror(errno));
    int child = process_begin(args, fd[0], err);
    close(fd[0]);
    int rc = child < 0 ? -1 : 0;
    if (child < 0)
        close(fd[1]);
    else if (growth_frames_feed(fd[1], n, err) |
             process_end(child, program, &cost, err))
        rc = -1;
    return rc ? rc : growth_add_program(g, (double)n, &cost, err);
}

/* spid-flame's time and memory over frames. */
static int growth_frames(struct room *r, struct error *err)
{
    struct growth g = {.b = r->b, .of = "frames", .how = "spid-flame, a pipe"};
    char program[PROCESS_PATH];

    if (!r->b->head)
        return 0;
    if (process_find(program, "spid-flame", err))
        return -1;
    for (size_t n = 100; n <= 100000 && growth_goes_on(&g, (double)n); n *= 10)
        if (growth_frames_point(&g, r, program, n, err))
            return -1;
    growth_note(&g);
    return 0;
}

/* ---- people -------------------------------------------------------------- */

/* A list of n clips of one frame each, every one a person of its own. */
static int growth_people_list(const struct room *r, const char *list, size_t n,
                              struct error *err)
{
    FILE *f = fopen(list, "w");

    for (size_t i = 0; f && i < n; i++)
        fprintf(f, "%s/me.png\t%s/me.png\t%s/out-%zu-%zu.png\n", r->dir,
                r->dir, r->dir, n, i);
    if (!f || ferror(f) | fclose(f))
        return error_set(err, EX_IOERR, "%s: cannot be written", list);
    return 0;
}

/* spid-animate's over people, each of whom is drawn once. */
static int growth_people(struct room *r, struct error *err)
{
    static const size_t count[] = {1, 2, 5, 10, 20, 50, 100, 200};
    struct growth g = {.b = r->b, .of = "people",
                       .how = "spid-animate --list, a frame each"};
    char synth[PROCESS_PATH], animate[PROCESS_PATH], me[ROOM], list[ROOM];
    const char *const make[] = {synth, "-q", "--head", r->b->head, "-o",
                                growth_room_at(me, r, "me.png"), NULL};
    const char *const args[] = {animate, "-q", "-j", r->threads, "-m",
                                r->b->model, "--head", r->b->head, "--star",
                                "--list", growth_room_at(list, r, "list"),
                                NULL};

    if (!r->b->model || !r->b->head)
        return 0;
    if (process_find(synth, "spid-synth", err) ||
        process_find(animate, "spid-animate", err) ||
        process_run(make, -1, NULL, err))
        return -1;
    for (size_t i = 0; i < 8 && growth_goes_on(&g, (double)count[i]); i++)
        if (growth_people_list(r, list, count[i], err) ||
            growth_add_point(&g, (double)count[i], args, err))
            return -1;
    growth_note(&g);
    return 0;
}

/* ---- bytes --------------------------------------------------------------- */

/* Header and table of a record whose CHUNK bytes are zeros, and the checksum
 * of no bytes, for the record that ends a stream. */
struct hole {
    struct layout_header header;
    struct layout_entry table;
    uint64_t nothing;
};

/* A record of zeros as long as CHUNK, its checksum with it, to be written as
 * a hole that no disk has to hold. */
static int growth_hole_init(struct hole *h, struct error *err)
{
    const struct array a = array_make("zeros", DTYPE_U8, NULL, 1, CHUNK, 0, 0,
                                      0);
    static const unsigned char zeros[1 << 16];
    struct hash *sum = hash_new();
    size_t bytes;

    if (!sum)
        return error_set(err, EX_OSERR, "out of memory");
    int rc = layout_put_table(&h->table, &bytes, &a, 1, err);
    hash_begin(sum);
    hash_add(sum, &h->table, sizeof h->table);
    for (size_t left = bytes - sizeof h->table; rc == 0 && left;) {
        size_t n = left < sizeof zeros ? left : sizeof zeros;

        hash_add(sum, zeros, n);
        left -= n;
    }
    layout_put_header(&h->header, "ZERO", 0, 0, 1, bytes, hash_end(sum));
    hash_begin(sum);
    h->nothing = hash_end(sum);
    hash_free(sum);
    return rc;
}

/* n records of which the file holds the first 128 bytes each. */
static int growth_hole_write(const struct hole *h, const char *path, size_t n,
                             struct error *err)
{
    const size_t step = sizeof h->header + h->header.payload_bytes;
    int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    struct layout_header end;
    bool ok = fd >= 0;

    layout_put_header(&end, RECORD_END, n, 0, 0, 0, h->nothing);
    for (size_t i = 0; ok && i < n; i++)
        ok = pwrite(fd, &h->header, sizeof h->header,
                    (off_t)(i * step)) == sizeof h->header &&
             pwrite(fd, &h->table, sizeof h->table,
                    (off_t)(i * step + sizeof h->header)) == sizeof h->table;
    ok = ok && pwrite(fd, &end, sizeof end, (off_t)(n * step)) == sizeof end;
    if (fd >= 0)
        ok = close(fd) == 0 && ok;
    return ok ? 0 : error_set(err, EX_IOERR, "%s: cannot be written", path);
}

/* spid-dump's over bytes, to a hundred billion. */
static int growth_bytes(struct room *r, struct error *err)
{
    static const double count[] = {1e8, 1e9, 1e10, 1e11};
    struct growth g = {.b = r->b, .of = "bytes",
                       .how = "spid-dump --check, a sparse file"};
    char program[PROCESS_PATH], path[ROOM];
    const char *const args[] = {program, "-q", "--check",
                                growth_room_at(path, r, "sparse.spid"), NULL};
    struct hole h;
    int rc = process_find(program, "spid-dump", err) ||
                     growth_hole_init(&h, err)
                 ? -1 : 0;

    for (size_t i = 0; rc == 0 && i < 4 && growth_goes_on(&g, count[i]); i++) {
        size_t n = (size_t)ceil(count[i] / (double)CHUNK);

        rc = growth_hole_write(&h, path, n, err);
        if (rc == 0)
            rc = growth_add_point(&g, (double)(n * CHUNK), args, err);
        unlink(path);
    }
    growth_note(&g);
    return rc;
}

int growth_of_programs(struct bench *b, struct error *err)
{
    struct room r;

    if (growth_room_open(&r, b, err))
        return -1;
    int rc = growth_frames(&r, err) || growth_bytes(&r, err) ||
             growth_people(&r, err) ? -1 : 0;
    growth_room_close(&r);
    return rc;
}
