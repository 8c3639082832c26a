/* GrabCut (Rother, Kolmogorov and Blake 2004): a person segmented from the
 * background by colour, given some pixels of each.  May throw what OpenCV
 * throws. */
#ifndef SPID_FORMATS_GRABCUT_H
#define SPID_FORMATS_GRABCUT_H

#include <opencv2/core.hpp>

/* What cv::grabCut does with GC_INIT_WITH_MASK, in half its time: the cut is of
 * undecided pixels only.  The same labels, but where several cuts are equally
 * good, as in a picture of one colour.
 *   label   (H, W) CV_8U, its GC_ classes, both sides present; updated
 *   rgb     (H, W) CV_8UC3
 *   rounds  of fitting the colours and cutting */
void grabcut_run(cv::Mat &label, const cv::Mat &rgb, int rounds);

#endif
