/* libFuzzer target: meshes as Wavefront OBJ, and MakeHuman's bindings. */
#include "lib/lab/people/wavefront.h"
#include "tests/fuzz/memory_file.h"

#define BASE_VERTICES 8
#define ASSET_VERTICES 3

/* 1 when a corner lies outside of the lists. */
static int wavefront_outside(const struct wavefront *m)
{
    for (size_t i = 0; i < 3 * m->nf; i++)
        if ((size_t)m->f[i] >= m->nv
            || (m->nt && (size_t)m->ft[i] >= m->nt))
            return 1;
    return 0;
}

static int wavefront_read_all(const char *path)
{
    static const float base[3 * BASE_VERTICES];
    const char *const group[] = { NULL, "body" };
    float out[3 * ASSET_VERTICES];
    struct wavefront m;
    struct mhclo binding;
    struct arena memory = {0};
    struct error err;
    int bad = 0;

    for (int i = 0; i < 2; i++)
        if (wavefront_read(&m, path, group[i], &memory, &err) == 0)
            bad |= wavefront_outside(&m);
    if (mhclo_read(&binding, path, BASE_VERTICES, ASSET_VERTICES, &memory,
                   &err) == 0)
        mhclo_place(out, &binding, base);
    arena_release(&memory);
    return bad;
}

FUZZ_FILE(wavefront_read_all)
