/* Time against error: what spid-bench's stages share.  A stage is
 *     int bench_STAGE(struct bench *b, struct error *err)
 * in lib/lab/bench/bench_STAGE.c: it times calls with bench_time, adds rows with
 * bench_add, and marks the Pareto front with bench_pareto.  To add one,
 * declare it at the end of this file and list it in cmd/lab/spid-bench.c. */
#ifndef SPID_LAB_BENCH_BENCH_H
#define SPID_LAB_BENCH_BENCH_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

struct bench_row {
    char stage[16];
    char config[96];          /* "512x512 N=108658 C=3 f32" */
    char knob[64];            /* "default", "alpha cut 1/128" */
    int threads;
    double ms_min, ms_median, ms_p95;
    double max_abs, psnr_db;  /* against the truth; NaN: nothing to compare */
    bool pareto;
};

struct bench_pair {           /* "fps": {"spid_star": 190.2} */
    char object[16], key[24];
    double value;
};

struct bench {
    /* set by the program */
    double seconds;           /* about how long one stage may take */
    int threads;
    const char *model;        /* model.safetensors, or NULL: none found */
    const char *head;         /* head.safetensors, or NULL */
    const char *scene;        /* --scene FILE, or NULL */

    /* filled by the stages */
    struct bench_row *row;
    size_t rows, row_room;
    struct bench_pair *pair;
    size_t pairs, pair_room;
    char *notes;              /* lines for people, after the table */
    size_t notes_length;
};

/* No rows yet; one thread, 20 seconds. */
void bench_init(struct bench *b);
/* Free what it holds; zeroed then. */
void bench_release(struct bench *b);

/* Times of repeated calls, milliseconds. */
struct bench_times {
    size_t runs;
    double min, median, p95;
};

/* Of n > 0 times, which are sorted. */
struct bench_times bench_quantiles(double *ms, size_t n);
/* Call repeatedly for about `seconds`, at least `min` times (after one that
 * is not counted).  -1 when a call fails. */
int bench_time(struct bench_times *t, double seconds, size_t min,
               int (*call)(void *context, struct error *err), void *context,
               struct error *err);

/* Append a row; NULL when there is no memory. */
struct bench_row *bench_add(struct bench *b, const char *stage,
                            const char *config, const char *knob, int threads,
                            const struct bench_times *t, double max_abs,
                            double psnr_db);

/* Whether they compete, on one curve of a plot: rows of the same stage, config
 * and threads. */
bool bench_same_group(const struct bench_row *a, const struct bench_row *b);
/* Mark, among rows first .. that compete, those that no other beats in both
 * ms_min and psnr_db. */
void bench_pareto(struct bench *b, size_t first);

/* A line after the table. */
void bench_note(struct bench *b, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* A number for the JSON's "fps" or "ms", in place of an earlier one of the
 * same name. */
void bench_number(struct bench *b, const char *object, const char *key,
                  double value);

/* Greatest difference, and PSNR with a peak of 1, of n values. */
void bench_compare(double *max_abs, double *psnr_db, const float *x,
                   const double *truth, size_t n);

/* The report as text the caller frees; NULL when there is no memory: a table
 * for people (with the paper's figures beside ours when the pipeline was
 * timed), one JSON object, or a row per line with tabs between. */
char *bench_table(const struct bench *b);
/* One JSON object. */
char *bench_json(const struct bench *b);
/* A row per line with tabs between. */
char *bench_tsv(const struct bench *b);

/* A gnuplot script, as text the caller frees, that draws the rows with an
 * error into `file` (.png, .svg or .pdf): time across, error upwards, both
 * logarithmic, the Pareto fronts as lines.
 * EX_DATAERR when no row has an error. */
char *bench_plot(const struct bench *b, const char *file, struct error *err);

/* ---- the stages ---------------------------------------------------------- */

/* The rasteriser on a scene, with every knob beside the error it costs. */
int bench_splat(struct bench *b, struct error *err);
/* The crop, E_m in its precisions, and its heads. */
int bench_motion(struct bench *b, struct error *err);
/* E_beta in its precisions. */
int bench_shape(struct bench *b, struct error *err);
int bench_refine(struct bench *b, struct error *err);
/* Head meshes: posing one, with every direction active. */
int bench_flame(struct bench *b, struct error *err);
/* Baking a person, with the paper's networks, too, and what a frame of Phase B
 * moves. */
int bench_branches(struct bench *b, struct error *err);
/* The whole of Phase B as spid animate runs it, SpiD and SpiD*. */
int bench_pipeline(struct bench *b, struct error *err);
/* Whole programs beside busy ones, on more threads than there are processors,
 * and at nice 19. */
int bench_shared(struct bench *b, struct error *err);
/* Training steps of the encoder and the whole system. */
int bench_train(struct bench *b, struct error *err);

#endif
