/* Sizes of the blocks of pairs.h, which plans need, too.  Private to
 * lib/nn. */
#ifndef SPID_NN_PAIRS_SIZE_H
#define SPID_NN_PAIRS_SIZE_H

#define PAIRS_PANEL 16       /* columns that lie together */
#define PAIRS_ROWS 12        /* rows of the result held in registers */

#endif
