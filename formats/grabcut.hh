/* GrabCut (Rother, Kolmogorov and Blake 2004): a person and a background told
 * apart by colours, of which some pixels are seeds.  May throw what OpenCV
 * throws. */
#ifndef SPID_FORMATS_GRABCUT_H
#define SPID_FORMATS_GRABCUT_H

#include <opencv2/core.hpp>

/* What cv::grabCut does to label (its GC_ classes, some of either side) with
 * GC_INIT_WITH_MASK, to the pixel: rgb of bytes, as large.  In half its time,
 * for only pixels that are undecided are cut, along shortest paths. */
void grabcut_run(cv::Mat &label, const cv::Mat &rgb, int rounds);

#endif
