/* Whole programs where others want the processors, too: spid-motion and
 * spid-animate on a clip, alone, beside programs that do nothing but turn,
 * beside another of the toolkit's, on more threads than there are processors,
 * and at nice 19.  Circumstances take turns, so that what the machine does
 * besides falls on all of them. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/base/cpu.h"
#include "lib/base/file.h"
#include "lib/lab/bench/bench_avatar.h"

#define FRAMES 60           /* of the clip: longer than what starting takes */
#define ROUNDS 64           /* at most */
#define BEGIN_US 100000     /* microseconds until neighbours are under way */
#define MAX_THREADS 4      /* for each that -j says: the row of too many */

/* What a program runs beside, and how. */
static const struct circumstance {
    const char *knob;
    int loops;              /* busy programs */
    bool spid;              /* SpiD's spid-animate */
    bool threads;           /* MAX_THREADS times as many as -j says */
    int nice;               /* added to this program's */
} circumstances[] = {
    {.knob = "alone"},
    {.knob = "beside 1 busy loop", .loops = 1},
    {.knob = "beside 2", .loops = 2},
    {.knob = "beside 4", .loops = 4},
    {.knob = "beside another spid", .spid = true},
    {.knob = "with -j four times", .threads = true},
    {.knob = "at nice 19, beside 1 busy loop", .loops = 1, .nice = 19}
};
enum { CASES = sizeof circumstances / sizeof *circumstances };

struct shared {
    struct bench *b;
    char dir[FILE_TEMPORARY], clip[FILE_TEMPORARY + 16];
    char photo[FILE_TEMPORARY + 16];
    char programs[FILE_TEMPORARY];      /* their folder, with a slash */
};

/* The programs that are timed, and the neighbour. */
enum program { MOTION, STAR, SPID, PROGRAMS };
static const char *const program_name[] = {
    "spid-motion", "spid-animate --star", "spid-animate"
};

/* Replace this process by the program; the child's part. */
static void shared_exec(const struct shared *s, enum program program,
                        int threads)
{
    char path[FILE_TEMPORARY + 16], j[16];
    const char *model = s->b->model;
    const char *motion[] = {"spid-motion", "-q", "-j", j, "-m", model,
                            s->clip, "-o", "/dev/null", NULL};
    const char *animate[] = {"spid-animate", "-q", "-j", j, "-m", model,
                             s->photo, s->clip, "--format", "y4m",
                             "-o", "/dev/null",
                             program == STAR ? "--star" : NULL, NULL};
    const char **args = program == MOTION ? motion : animate;

    snprintf(j, sizeof j, "%d", threads);
    snprintf(path, sizeof path, "%s%s", s->programs, args[0]);
    execv(path, (char *const *)args);
    _exit(127);
}

/* A child that ends with this process.  PROGRAMS: a busy loop. */
static pid_t shared_start(const struct shared *s, enum program program,
                          int threads, int lower)
{
    const pid_t child = fork();

    if (child)
        return child;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    (void)!nice(lower);
    if (program != PROGRAMS)
        shared_exec(s, program, threads);
    for (volatile unsigned turns = 0;; turns++)
        ;
}

/* Milliseconds of the program in those circumstances; NAN when it fails. */
static double shared_time(const struct shared *s, enum program program,
                          const struct circumstance *c)
{
    pid_t beside[8] = {0};
    int n = 0, status = -1;
    const int threads = s->b->threads * (c->threads ? MAX_THREADS : 1);

    while (n < c->loops)
        beside[n++] = shared_start(s, PROGRAMS, 0, 0);
    if (c->spid)
        beside[n++] = shared_start(s, SPID, s->b->threads, 0);
    if (n)
        usleep(BEGIN_US);
    const double begun = cpu_seconds();
    const pid_t timed = shared_start(s, program, threads, c->nice);
    const bool ended = timed > 0 && waitpid(timed, &status, 0) == timed;
    const double ms = 1e3 * (cpu_seconds() - begun);

    for (int i = 0; i < n; i++)
        if (beside[i] > 0) {
            kill(beside[i], SIGKILL);
            waitpid(beside[i], NULL, 0);
        }
    return ended && status == 0 ? ms : (double)NAN;
}

/* Rows of a program's rounds, and how many times as long as alone each took: of
 * the rounds' own ratios median, least and most. */
static void shared_report(struct bench *b, enum program program,
                          double (*ms)[ROUNDS], const size_t rounds[CASES])
{
    char config[96];
    double times[ROUNDS], sorted[ROUNDS];

    snprintf(config, sizeof config, "%s, %d frames", program_name[program],
             FRAMES);
    for (int c = 0; c < CASES && rounds[c]; c++) {
        for (size_t r = 0; r < rounds[c]; r++)
            times[r] = ms[c][r] / ms[0][r];
        memcpy(sorted, ms[c], sizeof sorted);
        const struct bench_times t = bench_quantiles(sorted, rounds[c]);
        const struct bench_times x = bench_quantiles(times, rounds[c]);

        bench_add(b, "shared", config, circumstances[c].knob, b->threads, &t,
                  NAN, NAN);
        if (c == 0)
            continue;
        bench_note(b, "shared: %s %s: %.2f (%.2f to %.2f) times as long as "
                   "alone, rounds: %zu", program_name[program],
                   circumstances[c].knob, x.median, x.min,
                   times[rounds[c] - 1], rounds[c]);
    }
}

/* Rounds until the stage's time has passed, but alone and with one neighbour
 * in any case. */
static int shared_run(struct shared *s, struct error *err)
{
    static double ms[SPID][CASES][ROUNDS];
    const double begun = cpu_seconds();
    size_t rounds[CASES] = {0};

    for (int k = 0; k < CASES * ROUNDS; k++) {
        const int c = k % CASES, r = k / CASES;

        if (k > 1 && cpu_seconds() - begun > s->b->seconds)
            break;
        for (enum program p = 0; p < SPID; p++) {
            ms[p][c][r] = shared_time(s, p, &circumstances[c]);
            if (isnan(ms[p][c][r]))
                return error_set(err, EX_SOFTWARE, "%s%s %s failed",
                                 s->programs, program_name[p],
                                 circumstances[c].knob);
        }
        rounds[c]++;
    }
    for (enum program p = 0; p < SPID; p++)
        shared_report(s->b, p, ms[p], rounds);
    return 0;
}

/* A photograph and a clip of the same person; the programs are beside this
 * one. */
static int shared_open(struct shared *s, struct error *err)
{
    struct bench_person p;

    file_own_folder(s->programs, sizeof s->programs);
    int rc = bench_person_open(&p, s->b, err) || bench_folder(s->dir, err)
                 ? -1 : 0;
    snprintf(s->clip, sizeof s->clip, "%s/clip.mp4", s->dir);
    snprintf(s->photo, sizeof s->photo, "%s/photo.png", s->dir);
    if (rc == 0)
        rc = bench_person_write(&p, s->clip, FRAMES, err) ||
                     bench_person_write(&p, s->photo, 1, err)
                 ? -1
                 : 0;
    bench_person_close(&p);
    return rc;
}

int bench_shared(struct bench *b, struct error *err)
{
    struct shared s = {.b = b};
    const int rc = shared_open(&s, err) || shared_run(&s, err) ? -1 : 0;

    if (s.dir[0]) {
        unlink(s.clip);
        unlink(s.photo);
        rmdir(s.dir);
    }
    return rc;
}
