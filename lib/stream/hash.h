/* XXH3-64, the checksum of the stream, in pieces and by the widest vectors of
 * this machine: the library as Debian builds it knows SSE2 only and takes three
 * times as long, which a feature image of 17 MB feels at both ends of a pipe.
 * Internal to lib/stream. */
#ifndef SPID_STREAM_HASH_H
#define SPID_STREAM_HASH_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/isa.h"

struct hash;

struct hash *hash_new(void);              /* NULL: out of memory */
void hash_free(struct hash *h);           /* NULL is allowed */

/* XXH3-64 with seed 0 of all that was added since hash_begin. */
void hash_begin(struct hash *h);
/* So many bytes more. */
void hash_add(struct hash *h, const void *data, size_t bytes);
/* What it has come to; more may be added. */
uint64_t hash_end(const struct hash *h);

/* The same on the library's state, one version per instruction set. */
struct hash_table {
    void (*begin)(void *state);
    void (*add)(void *state, const void *data, size_t bytes);
    uint64_t (*end)(const void *state);
};

extern const struct hash_table hash_table_baseline;
#ifdef SPID_X86
extern const struct hash_table hash_table_avx2, hash_table_avx512;
#endif

#define HASH_ALIGN 64          /* of the state, and the most bytes it takes: */
#define HASH_BYTES 1024

#endif
