/* The kernels of each instruction set, compiled from *_tmpl.c, as one table
 * each. */
#include "lib/splat/kernels.h"

#include "lib/base/isa.h"

#define DECLARE(isa)                                                      \
    void splat_project_##isa(struct splat_state *, size_t, size_t);       \
    void splat_tile_##isa(const struct splat *, struct splat_work *,      \
                          uint32_t, const struct target *);               \
    void splat_tile_backward_##isa(const struct splat *,                  \
                                   struct splat_work *, uint32_t,         \
                                   const struct splat_picture_gradients   \
                                       *);                                \
    void splat_gaussian_backward_##isa(                                   \
        const struct splat *, size_t, size_t,                             \
        const struct splat_gradients *, double *);                        \
    size_t splat_work_size_##isa(void);
#define TABLE(isa)                                                        \
    {splat_project_##isa, splat_tile_##isa, splat_tile_backward_##isa,    \
     splat_gaussian_backward_##isa, splat_work_size_##isa}

DECLARE(baseline)
#ifdef SPID_X86
DECLARE(avx2)
DECLARE(avx512)
#endif

const struct splat_kernels *splat_kernels(enum cpu_level level)
{
    static const struct splat_kernels table[] = {
        TABLE(baseline),
#ifdef SPID_X86
        TABLE(avx2), TABLE(avx512)
#endif
    };

    return &table[level];
}
