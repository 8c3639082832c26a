/* From a photograph to the first frame: spid-animate as a process, its start,
 * Phase A and one picture; files are in the page cache.  The photograph is of
 * the networks' size, then of the largest that is taken as it is. */
#include "lib/base/sort.h"
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/file.h"
#include "lib/lab/bench/bench_avatar.h"
#include "lib/lab/bench/bench_process.h"

#define PARTS 3

struct start {
    struct bench *b;
    char program[PROCESS_PATH], threads[16];
    char dir[FILE_TEMPORARY];
    char picture[FILE_TEMPORARY + 16], stats[FILE_TEMPORARY + 16];
    double part[PARTS][64];     /* milliseconds, of each run */
    size_t runs;
};

static const char *const start_part[PARTS] = {
    "A: shape", "A: branches", "encoder"
};

/* The folder, and the files' names. */
static int bench_start_open(struct start *s, struct error *err)
{
    file_temporary(s->dir, "spid-bench-XXXXXX");
    if (!mkdtemp(s->dir)) {
        error_set(err, EX_CANTCREAT, "%s: no room for a picture", s->dir);
        s->dir[0] = 0;
        return -1;
    }
    snprintf(s->picture, sizeof s->picture, "%s/me.ppm", s->dir);
    snprintf(s->stats, sizeof s->stats, "%s/stats.tsv", s->dir);
    return 0;
}

/* The synthetic person's first frame as a file, so many times larger: what
 * each pixel says is said of a square. */
static int bench_start_write(struct start *s, const uint8_t *rgb, size_t times,
                             struct error *err)
{
    const size_t side = times * PERSON_SIZE;
    uint8_t *row = malloc(3 * side);
    FILE *f = fopen(s->picture, "wb");
    bool ok = row && f && fprintf(f, "P6 %zu %zu 255\n", side, side) > 0;

    for (size_t y = 0; ok && y < side; y++) {
        for (size_t x = 0; x < side; x++)
            memcpy(row + 3 * x, rgb + 3 * (y / times * PERSON_SIZE +
                                           x / times), 3);
        ok = fwrite(row, 3, side, f) == side;
    }
    free(row);
    if ((f && fclose(f)) || !ok)
        return error_set(err, EX_CANTCREAT, "%s: cannot be written",
                         s->picture);
    return 0;
}

/* What the run said of its parts. */
static void bench_start_read(struct start *s)
{
    char line[256];
    FILE *f = fopen(s->stats, "r");

    for (int i = 0; i < PARTS; i++)
        s->part[i][s->runs % 64] = 0;
    while (f && fgets(line, sizeof line, f))
        for (int i = 0; i < PARTS; i++) {
            const size_t n = strlen(start_part[i]);

            if (!strncmp(line, start_part[i], n) && line[n] == '\t')
                sscanf(line + n, "%*d %lf", &s->part[i][s->runs % 64]);
        }
    if (f)
        fclose(f);
    s->runs++;
}

/* One frame of the picture driven by itself. */
static int bench_start_call(void *context, struct error *err)
{
    struct start *s = context;
    const char *const args[] = {
        s->program, "-q", "-j", s->threads, "-m", s->b->model, "--head",
        s->b->head, "--stats", s->stats, "-f", "pam", "-o", "/dev/null",
        s->picture, s->picture, NULL
    };

    if (process_run(args, -1, NULL, err))
        return -1;
    bench_start_read(s);
    return 0;
}

/* A part's row. */
static bool bench_start_add_part(struct bench *b, struct start *s, int i)
{
    const size_t n = s->runs < 64 ? s->runs : 64;
    double *t = s->part[i];

    sort_doubles(t, n);
    const struct bench_times times = {n, t[0], t[n / 2],
                                      t[(n - 1) * 95 / 100]};
    return bench_add(b, "start", i < 2 ? "Phase A" : "first frame",
                     start_part[i], b->threads, &times, NAN, NAN) != NULL;
}

static void bench_start_close(struct start *s)
{
    if (!s->dir[0])
        return;
    unlink(s->picture);
    unlink(s->stats);
    rmdir(s->dir);
}

/* The row of a photograph so many times larger than the networks see. */
static int bench_start_time(struct start *s, const uint8_t *rgb, size_t times,
                            const char *name, struct error *err)
{
    struct bench *b = s->b;
    struct bench_times t;

    return bench_start_write(s, rgb, times, err) ||
           bench_time(&t, b->seconds, 7, bench_start_call, s, err) ||
           !bench_add(b, "start", "spid-animate, photo to first frame", name,
                      b->threads, &t, NAN, NAN) ? -1 : 0;
}

int bench_start(struct bench *b, struct error *err)
{
    struct bench_person *p = calloc(1, sizeof *p);
    struct start s = {.b = b};

    if (!p)
        return error_set(err, EX_OSERR, "no memory");
    snprintf(s.threads, sizeof s.threads, "%d", b->threads);
    int rc = bench_person_open(p, b, err) ||
             process_find(s.program, "spid-animate", err) ||
             bench_start_open(&s, err) ||
             bench_start_time(&s, p->rgb, 1, "default", err) ? -1 : 0;
    for (int i = 0; i < PARTS && rc == 0; i++)
        rc = bench_start_add_part(b, &s, i) ? 0 : -1;
    if (rc == 0)
        rc = bench_start_time(&s, p->rgb, 4, "photo of 2048", err);
    bench_start_close(&s);
    bench_person_close(p);
    free(p);
    return rc;
}
