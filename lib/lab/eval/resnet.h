/* ResNet-50 (He et al. 2015), its strides in the convolutions of 3 x 3, as a
 * pyramid of maps under the names of torchvision and timm.
 *
 * Level 0 is the stem at half the picture's size, 64 channels wide; levels 1 to
 * 4 are the stages, 256 to 2048 wide, each half as large as the one before. */
#ifndef SPID_LAB_EVAL_RESNET_H
#define SPID_LAB_EVAL_RESNET_H

#include "lib/nn/tape.h"

#define RESNET_LEVELS 5

/* Its steps on a new tape, for pictures of 3 pixels a side or more: tensors
 * "<at>conv1.weight" to "<at>layer4.2.bn3.running_var"; level: the maps, which are
 * kept. */
void resnet_declare(int level[RESNET_LEVELS], struct tape *t, const char *at);

#endif
