/* Streams as standard array files: one safetensors file, or a directory of
 * npy files.  Both hold everything needed to make the same stream again. */
#ifndef SPID_FORMATS_RECORDFILE_H
#define SPID_FORMATS_RECORDFILE_H

#include "formats/recordjson.h"
#include "formats/safetensors.h"
#include "lib/stream/stream.h"

struct recordfile;

/* A safetensors file: tensor "000012.MOTN.exp" is array exp of record 12 of
 * the stream, of type MOTN; metadata "spid.records" lists the records in
 * order, as JSON.  Records are kept in memory until recordfile_finish. */
struct recordfile *recordfile_create_st(const char *path, struct error *err);

/* A directory (made when it does not exist): MOTN.exp.npy holds array exp of
 * all MOTN records, stacked along a new first axis; when its shape changes
 * the next ones go to MOTN.exp.1.npy.  records.json lists the records. */
struct recordfile *recordfile_create_npy(const char *dir, struct error *err);

/* One more record: its row of the index, and its arrays.  -1 and *err when they
 * cannot be written. */
int recordfile_add(struct recordfile *w, const struct record *rec,
                   struct error *err);
/* Complete the files; frees w. */
int recordfile_finish(struct recordfile *w, struct error *err);
/* Free w and remove what is not complete, the directory too when it is new and
 * empty; NULL is allowed. */
void recordfile_abandon(struct recordfile *w);

/* Hand every record of such a file or directory to sink. */
int recordfile_read_st(const char *path, record_sink sink, void *context,
                       struct error *err);
/* The same of a directory that recordfile_create_npy wrote. */
int recordfile_read_npy(const char *dir, record_sink sink, void *context,
                        struct error *err);

#endif
