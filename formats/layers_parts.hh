/* What layers.cc and layers_enlarge.cc share.  Not for other modules.  All may
 * throw what OpenCV throws. */
#ifndef SPID_FORMATS_LAYERS_PARTS_H
#define SPID_FORMATS_LAYERS_PARTS_H

#include <algorithm>
#include <cstdint>

#include <opencv2/core.hpp>

/* f of ranges of so many rows each, by all threads. */
template <class F> void layers_each_band(int rows, int band, F f)
{
    cv::parallel_for_(cv::Range(0, (rows + band - 1) / band),
                      [&](const cv::Range &some) {
        for (int i = some.start; i < some.end; i++)
            f(cv::Range(band * i, std::min(rows, band * (i + 1))));
    });
}

/* 255 where a square of n by n pixels lies in its picture; inside NULL:
 * everywhere. */
cv::Mat layers_inside(const uint8_t *inside, int n);

/* colour (float) where known (0 or 1, float) says, averaged over its
 * surroundings, and how much of them is known. */
cv::Mat layers_mean(cv::Mat &weight, const cv::Mat &colour,
                    const cv::Mat &known, double reach);

/* How much of a pixel is the person's by its colour: *share 0 as the
 * background, 1 as the person; returns the trust in it, 0 where the two look
 * alike or the pixel is no mixture of them. */
float layers_share(float *share, const cv::Vec3f &pixel,
                   const cv::Vec3f &back, const cv::Vec3f &fore);

/* The person's colours that reach past the matte (bytes), of rgb (bytes): with
 * no matte of their own they would stay on the wall when the person moves.
 * in: 255 where the picture is. */
void layers_gather(cv::Mat &mat, const cv::Mat &rgb, const cv::Mat &in);

/* back (float) where the person's colour would have to be below 0 or above
 * what its matte allows: what makes the sum right again.  If that is another
 * colour than the background's about it, a part of the person that the matte
 * took for less than it is would stay behind on the wall: it gains matte
 * instead.  Pixel by pixel; colour in float. */
void layers_balance(cv::Mat &back, cv::Mat &mat, const cv::Mat &colour);

#endif
