/* Inside lib/photo: matting, once per instruction set. */
#ifndef SPID_PHOTO_MATTING_KERNEL_H
#define SPID_PHOTO_MATTING_KERNEL_H

#include "lib/base/isa.h"
#include "lib/photo/matting.h"

/* matting_solve but for what is behind the person and beyond the picture. */
typedef int matting_find_fn(struct matting *m, const float *prior, size_t w,
                            bool known, struct error *err);
ISA_VERSIONS(matting_find_fn, matting_find);

#endif
