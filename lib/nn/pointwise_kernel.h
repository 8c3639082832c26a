/* Sizes that the 1x1 kernels and their planning share.  Private to lib/nn. */
#ifndef SPID_NN_POINTWISE_KERNEL_H
#define SPID_NN_POINTWISE_KERNEL_H

#define POINTWISE_PANEL 16   /* columns of the packed weights */
#define POINTWISE_ROWS 12    /* rows of the result held in registers */
#define POINTWISE_PAIRS 64   /* pairs of rows summed before they are stored */

#endif
