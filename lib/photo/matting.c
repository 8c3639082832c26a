/* Matting's steps in order. */
#include "lib/photo/matting_kernel.h"

#include "lib/base/cpu.h"
#include "lib/photo/backdrop.h"
#include "lib/photo/margin.h"

int matting_solve(struct matting *m, const float *prior, size_t w, bool known,
                  struct error *err)
{
    return CPU_PICK(matting_find)(m, prior, w, known, err) ||
           backdrop_fill(m, err) || margin_fill(m, err) ? -1 : 0;
}
