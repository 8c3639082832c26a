/* The hash of the xxHash library, compiled here once per instruction set. */
#define XXH_INLINE_ALL
#include <xxhash.h>

#include "lib/stream/hash.h"

_Static_assert(sizeof(XXH3_state_t) <= HASH_BYTES, "room for the state");

/* Seed 0. */
static void hash_state_begin(void *state)
{
    XXH3_64bits_reset(state);
}

static void hash_state_add(void *state, const void *data, size_t bytes)
{
    XXH3_64bits_update(state, data, bytes);
}

static uint64_t hash_state_end(const void *state)
{
    return XXH3_64bits_digest(state);
}

const struct hash_table ISA(hash_table) = {hash_state_begin, hash_state_add,
                                           hash_state_end};
