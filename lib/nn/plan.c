/* Memory and options of a planned network: buffers that live as long as it,
 * maps that layers pass on to each other, one scratch for all. */
#include "lib/nn/plan.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sysexits.h>

#include "lib/nn/engine.h"

int nn_type_parse(enum nn_type *type, const char *word)
{
    for (int i = NN_F32; i <= NN_INT8; i++)
        if (!strcmp(word, nn_type_name((enum nn_type)i))) {
            *type = (enum nn_type)i;
            return 0;
        }
    return -1;
}

const char *nn_type_name(enum nn_type type)
{
    static const char *const name[] = { [NN_F32] = "f32", [NN_BF16] = "bf16",
                                        [NN_FAST] = "fast",
                                        [NN_INT8] = "int8" };

    return name[type];
}

void nn_plan_init(struct nn_plan *p, struct nn_options opt)
{
    memset(p, 0, sizeof *p);
    p->opt = opt;
    if (opt.type > NN_BF16 && opt.mode != NN_INFER)
        nn_plan_fail(p, EX_SOFTWARE, "%s is for inference only",
                     nn_type_name(opt.type));
}

#define HUGE ((size_t)2 << 20)   /* bytes of a huge page */

/* Bytes that nn_plan_zeros takes from the system for so many; 0: it is left
 * to the heap. */
static size_t nn_plan_mapped(size_t bytes)
{
    return bytes < HUGE / 2 || bytes > SIZE_MAX - 2 * HUGE
               ? 0 : (bytes + HUGE - 1) & ~(HUGE - 1);
}

/* Give back what nn_plan_zeros gave, or NULL. */
static void nn_plan_drop(void *data, size_t bytes)
{
    size_t mapped = nn_plan_mapped(bytes);

    if (mapped && data)
        munmap(data, mapped);
    else
        free(data);
}

void nn_plan_release(struct nn_plan *p)
{
    for (size_t i = 0; i < p->chunks; i++)
        nn_plan_drop(p->chunk[i].data, p->chunk[i].size);
    free(p->chunk);
    nn_plan_drop(p->scratch, p->scratch_room);
    memset(p, 0, sizeof *p);
}

void nn_plan_fail(struct nn_plan *p, int code, const char *format, ...)
{
    if (p->err.code)
        return;
    va_list ap;
    va_start(ap, format);
    vsnprintf(p->err.text, sizeof p->err.text, format, ap);
    va_end(ap);
    p->err.code = code;
}

/* `mapped` zero bytes (whole huge pages) at a huge page's border, which become
 * memory when they are touched, or NULL. */
static void *nn_plan_map_zeros(size_t mapped)
{
    const size_t all = mapped + HUGE;
    char *base = mmap(NULL, all, PROT_READ | PROT_WRITE,
                      MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

    if (base == MAP_FAILED)
        return NULL;
    const size_t before = (HUGE - (uintptr_t)base % HUGE) % HUGE;
    if (before)
        munmap(base, before);
    if (before < HUGE)
        munmap(base + before + mapped, HUGE - before);
#ifdef MADV_HUGEPAGE
    madvise(base + before, mapped, MADV_HUGEPAGE);
#endif
    return base + before;
}

/* Large buffers in huge pages where the system has them: kernels walk across
 * many rows and planes at once, more than there are entries for small pages. */
static void *nn_plan_zeros(size_t bytes)
{
    const size_t mapped = nn_plan_mapped(bytes);

    if (bytes > SIZE_MAX - 2 * HUGE)
        return NULL;
    if (mapped)
        return nn_plan_map_zeros(mapped);
    size_t size = (bytes + 63) & ~(size_t)63;
    void *data = aligned_alloc(64, size);
    return data ? memset(data, 0, size) : NULL;
}

/* The smallest idle chunk that is large enough. */
static struct nn_chunk *nn_plan_idle_chunk(struct nn_plan *p, size_t bytes)
{
    struct nn_chunk *best = NULL;

    for (size_t i = 0; i < p->chunks; i++) {
        struct nn_chunk *c = &p->chunk[i];

        if (c->idle && c->size >= bytes && (!best || c->size < best->size))
            best = c;
    }
    return best;
}

void *nn_plan_bytes(struct nn_plan *p, size_t bytes)
{
    if (p->err.code)
        return NULL;
    if (p->chunks == p->room) {
        size_t room = p->room ? 2 * p->room : 64;
        void *grown = realloc(p->chunk, room * sizeof *p->chunk);

        if (!grown) {
            nn_plan_fail(p, EX_OSERR, "out of memory");
            return NULL;
        }
        p->chunk = grown;
        p->room = room;
    }
    bytes = bytes ? bytes : 64;
    void *data = nn_plan_zeros(bytes);
    if (!data) {
        nn_plan_fail(p, EX_OSERR, "out of memory (%zu bytes more)", bytes);
        return NULL;
    }
    p->chunk[p->chunks++] = (struct nn_chunk){ data, bytes, false };
    return data;
}

float *nn_plan_floats(struct nn_plan *p, size_t count)
{
    return nn_plan_bytes(p, count * sizeof(float));
}

float *nn_plan_map(struct nn_plan *p, size_t count)
{
    size_t bytes = count * sizeof(float);
    struct nn_chunk *c = p->err.code ? NULL : nn_plan_idle_chunk(p, bytes);

    if (!c)
        return nn_plan_bytes(p, bytes);
    c->idle = false;
    return c->data;
}

void nn_plan_free(struct nn_plan *p, void *map)
{
    for (size_t i = 0; i < p->chunks; i++)
        if (p->chunk[i].data == map)
            p->chunk[i].idle = true;
}

void nn_plan_recycle(struct nn_plan *p, void *map)
{
    if (!nn_plan_backward(p))
        nn_plan_free(p, map);
}

void nn_plan_scratch(struct nn_plan *p, size_t bytes)
{
    if (bytes > p->scratch_size)
        p->scratch_size = bytes;
}

int nn_plan_finish(struct nn_plan *p, struct error *err)
{
    if (!p->err.code) {
        nn_plan_drop(p->scratch, p->scratch_room);
        p->scratch_room = p->scratch_size + 64;
        p->scratch = nn_plan_zeros(p->scratch_room);
        if (!p->scratch)
            nn_plan_fail(p, EX_OSERR, "out of memory (%zu bytes of scratch)",
                         p->scratch_size);
    }
    if (p->err.code) {
        if (err)
            *err = p->err;
        return -1;
    }
    return 0;
}
