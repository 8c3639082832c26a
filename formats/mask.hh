/* Masks of OpenCV (bytes, 0 or 255) and their pieces, the connected components,
 * for whoever cuts a person out.  All may throw what OpenCV throws. */
#ifndef SPID_FORMATS_MASK_H
#define SPID_FORMATS_MASK_H

#include <vector>

#include <opencv2/core.hpp>

/* A brush of odd width, side or one more, for dilating and eroding. */
cv::Mat mask_disc(int side);

/* For each of so many labels whether a pixel of the mask has it: 255 or 0. */
std::vector<uchar> mask_touched(const cv::Mat &label, int labels,
                                const cv::Mat &mask);

/* The pixels whose label is kept: 255 of the label's. */
cv::Mat mask_of_labels(const cv::Mat &label, const std::vector<uchar> &keep);

/* The piece of a mask that covers most of the head; empty where none does. */
cv::Mat mask_piece_of_head(const cv::Mat &mask, const cv::Mat &head);

#endif
