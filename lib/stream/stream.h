/* The record stream: what flows through the pipes.  man/spid-stream.5 is the
 * byte-level truth; this is its reader and writer. */
#ifndef SPID_STREAM_STREAM_H
#define SPID_STREAM_STREAM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/uio.h>

#include "lib/base/error.h"

#define STREAM_MAGIC "SPID"    /* how every record begins */
#define STREAM_VERSION 1
#define STREAM_ALIGN 64        /* arrays start at multiples of this */
#define STREAM_MAX_ARRAYS 64   /* per record */
#define STREAM_MAX_BYTES ((size_t)1 << 30) /* default limit of one payload */
#define STREAM_NAME 24         /* array name, NUL included */

enum dtype { DTYPE_U8, DTYPE_I32, DTYPE_F16, DTYPE_F32, DTYPE_F64 };

size_t dtype_size(enum dtype t);        /* bytes of one element */
const char *dtype_name(enum dtype t);   /* "u8" "i32" "f16" "f32" "f64" */

/* A named array.  Reading: data points into the record's payload.  Writing:
 * data is the caller's, read during stream_write only. */
struct array {
    char name[STREAM_NAME];
    enum dtype dtype;
    int ndim;                  /* 0 (scalar) to 4 */
    size_t dim[4];
    const void *data;          /* row-major, little-endian, 64-byte aligned */
};

size_t array_count(const struct array *a);   /* product of dims */
size_t array_bytes(const struct array *a);

/* The types of records that spid-stream(5) knows; their arrays are in
 * lib/stream/schema.c. */
#define RECORD_CONF "CONF"     /* first of all: producer, units, camera */
#define RECORD_SRCI "SRCI"     /* the source picture */
#define RECORD_SHAP "SHAP"     /* a person's shape */
#define RECORD_MOTN "MOTN"     /* motion of a frame */
#define RECORD_MESH "MESH"     /* the head's vertices in a frame */
#define RECORD_GAUS "GAUS"     /* a whole set of Gaussians */
#define RECORD_GMOV "GMOV"     /* what of it moved */
#define RECORD_FEAT "FEAT"     /* drawn features */
#define RECORD_IMAG "IMAG"     /* a picture */
#define RECORD_END  "END "     /* last of all */

struct record {
    char type[5];              /* RECORD_MESH or any, NUL-terminated */
    uint64_t frame;            /* index within the clip, from 0 */
    double time;               /* seconds from the clip's start */
    int count;                 /* of arrays */
    struct array array[STREAM_MAX_ARRAYS];
    /* Set by stream_read, for stream_copy; payload NULL in a hand-made one. */
    const void *payload;
    size_t payload_bytes;
    uint64_t payload_hash;
};

/* True when the record's type is the four letters given. */
bool record_is(const struct record *rec, const char *type);

/* The array of that name, or NULL. */
const struct array *record_find(const struct record *rec, const char *name);

/* The data of an array that must be there with this dtype and shape; a
 * dimension of 0 in dims accepts any size.  On a mismatch returns NULL and
 * *err says which array, what was found and what was expected; file and frame
 * are the caller's to put in front (error_prefix). */
const void *record_get(const struct record *rec, const char *name,
                       enum dtype dtype, int ndim, const size_t *dims,
                       struct error *err);

/* *to: rec with its data in the block that is returned, which the caller frees;
 * NULL without memory. */
void *record_keep(struct record *to, const struct record *rec,
                  struct error *err);

/* Copy to out the arrays of rec whose names are not in known (NULL ends the
 * list): what a stage hands on although it does not know it.  out has room for
 * STREAM_MAX_ARRAYS - used more; returns how many were copied. */
int record_others(struct array *out, int used, const struct record *rec,
                  const char *const *known);

/* 0, or -1 with record, array and index of the first NaN or infinity among
 * the record's floating-point arrays. */
int record_check_finite(const struct record *rec, struct error *err);

/* ---- reading ---------------------------------------------------------- */

struct stream_reader;

struct stream_options {
    size_t max_bytes;          /* of one payload; 0: stream_set_limit's */
    bool trust;                /* skip the payload checksum */
    bool pair;                 /* a record's data stay valid until the call
                                * after the next one */
};

/* Largest payload that readers opened from now on accept, unless their options
 * say otherwise; STREAM_MAX_BYTES at start.  --max-bytes sets it. */
void stream_set_limit(size_t max_bytes);
/* What it is now, bytes. */
size_t stream_limit(void);

/* Whether a regular file begins as a stream does.  Nothing else is looked at:
 * what a pipe has given is gone. */
bool stream_probe(const char *path);

/* Open path ("-" is standard input).  A regular file is mapped, a pipe read in
 * large blocks.  Refuses a directory, and a terminal.  NULL on failure. */
struct stream_reader *stream_open(const char *path,
                                  const struct stream_options *opt,
                                  struct error *err);

/* Read from memory: data is the caller's, 64-byte aligned, and outlives the
 * reader. */
struct stream_reader *stream_open_memory(const void *data, size_t bytes,
                                         const char *name,
                                         const struct stream_options *opt,
                                         struct error *err);

/* Next record.  1: *rec is filled; its data stay valid until the next call.
 * 0: END was read.  -1: short read, bad magic or checksum, too large, or no
 * END; *err names the file and the last good frame.  Nothing is allocated
 * before its size has been checked. */
int stream_read(struct stream_reader *r, struct record *rec,
                struct error *err);

/* Name for messages: the path, or "<stdin>". */
const char *stream_name(const struct stream_reader *r);
/* -1, and err begins with where it is: the stream's name and rec's frame. */
int stream_blame(const struct stream_reader *r, const struct record *rec,
                 struct error *err);

void stream_close(struct stream_reader *r);      /* NULL is allowed */

/* What takes records one by one; data are valid during the call.  0; 1: it wants
 * no more; -1 and *err. */
typedef int (*record_sink)(const struct record *rec, void *context,
                           struct error *err);
/* Hand sink every record that comes.  0: END was read; 1: sink has ended it; -1
 * and *err, which names file and frame. */
int stream_each(struct stream_reader *r, record_sink sink, void *context,
                struct error *err);
/* The same of a file that is opened for it, and closed. */
int stream_load(const char *path, record_sink sink, void *context,
                struct error *err);

/* ---- writing ---------------------------------------------------------- */

struct stream_writer;

/* Open path ("-" is standard output; a terminal is refused).  A named file is
 * written as PATH.part and takes its name in stream_finish. */
struct stream_writer *stream_create(const char *path, struct error *err);

/* Write one record.  0, or -1 (closed pipe, full disk). */
int stream_write(struct stream_writer *w, const char *type, uint64_t frame,
                 double time, const struct array *arrays, int count,
                 struct error *err);

/* The same, the data of the first array in parts, one after another, whose
 * bytes add up to its own (its pointer is not used): what lies scattered is
 * written without a copy.  part NULL: as stream_write. */
int stream_write_parts(struct stream_writer *w, const char *type,
                       uint64_t frame, double time,
                       const struct array *arrays, int count,
                       const struct iovec *part, size_t parts,
                       struct error *err);

/* Pass a record on as it was read; changes made to rec->array since then are
 * not seen (write those with stream_write). */
int stream_copy(struct stream_writer *w, const struct record *rec,
                struct error *err);

/* Write END, flush, close and rename; frees w.  0, or -1 when the last bytes
 * did not arrive. */
int stream_finish(struct stream_writer *w, struct error *err);

/* Give up: no END is written, so that the next program knows.  Complete
 * records stay in PATH.part; an empty PATH.part is removed.  Frees w. */
void stream_abandon(struct stream_writer *w);

/* ---- making arrays ---------------------------------------------------- */

/* An array over the caller's data; unused dims are 0:
 * array_make("mean", DTYPE_F32, mean, 2, N, 3, 0, 0). */
struct array array_make(const char *name, enum dtype dtype, const void *data,
                        int ndim, size_t d0, size_t d1, size_t d2, size_t d3);

#endif
