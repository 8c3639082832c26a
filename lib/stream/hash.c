/* The stream's checksum: XXH3-64 with this processor's widest vectors. */
#include "lib/stream/hash.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"

struct hash {
    _Alignas(HASH_ALIGN) unsigned char state[HASH_BYTES];
    const struct hash_table *f;
};

/* The widest that this processor has, or $SPID_CPU allows. */
static const struct hash_table *hash_version(void)
{
    return CPU_PICK(&hash_table_baseline, &hash_table_avx2,
                    &hash_table_avx512);
}

struct hash *hash_new(void)
{
    struct hash *h = aligned_alloc(_Alignof(struct hash), sizeof *h);

    if (!h)
        return NULL;
    memset(h, 0, sizeof *h);   /* the library asks for it */
    h->f = hash_version();
    return h;
}

void hash_free(struct hash *h)
{
    free(h);
}

void hash_begin(struct hash *h)
{
    h->f->begin(h->state);
}

void hash_add(struct hash *h, const void *data, size_t bytes)
{
    h->f->add(h->state, data, bytes);
}

uint64_t hash_end(const struct hash *h)
{
    return h->f->end(h->state);
}
