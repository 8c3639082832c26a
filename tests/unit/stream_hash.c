/* Every version of the stream's hash against the library's, whole and in
 * pieces of all sizes. */
#include <stdio.h>
#include <stdlib.h>
#include <xxhash.h>

#include "lib/base/cpu.h"
#include "lib/stream/hash.h"

#define BYTES 70000

static _Alignas(HASH_ALIGN) unsigned char state[HASH_BYTES];
static unsigned char data[BYTES];

static void hash_compare(const struct hash_table *f, size_t n, size_t piece)
{
    f->begin(state);
    for (size_t at = 0; at < n; at += piece)
        f->add(state, data + at, n - at < piece ? n - at : piece);
    if (f->end(state) == XXH3_64bits(data, n))
        return;
    fprintf(stderr, "%zu bytes in pieces of %zu: another hash\n", n, piece);
    exit(1);
}

static void hash_check(const struct hash_table *f)
{
    for (size_t n = 0; n < 1200; n++) {
        hash_compare(f, n, BYTES);
        hash_compare(f, n, 1 + n % 67);
    }
    for (size_t piece = 1; piece <= BYTES; piece = 2 * piece + 1)
        hash_compare(f, BYTES, piece);
}

int main(void)
{
    for (size_t i = 0; i < BYTES; i++)
        data[i] = (unsigned char)(i * 2654435761u >> 13);
    hash_check(&hash_table_baseline);
#ifdef SPID_X86
    if (cpu_level() >= CPU_AVX2)
        hash_check(&hash_table_avx2);
    if (cpu_level() >= CPU_AVX512)
        hash_check(&hash_table_avx512);
#endif
    return 0;
}
