/* Connected components of a matte, and how far they are from the person
 * (layers_islands.h). */
extern "C" {
#include "formats/layers_islands.h"
}
#include "formats/mask.hh"

#include <algorithm>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

static const int ISLANDS_SOLID = 40;    /* of 255: fainter is no piece */
static const int ISLANDS_LARGE = 50;    /* pieces of a picture: one is kept */

/* Pixels to the next one of the mask.  Dilating by as many would take time by
 * their square: seconds at 2048. */
static cv::Mat islands_distance(const cv::Mat &mask)
{
    cv::Mat away;

    cv::distanceTransform(mask == 0, away, cv::DIST_L2, cv::DIST_MASK_3);
    return away;
}

void layers_islands(uint8_t *matte, size_t n)
{
    const int N = (int)n, near = std::max(2, N / 64);
    cv::Mat mat(N, N, CV_8U, matte), label, stats, centre, away;
    const cv::Mat solid = mat > ISLANDS_SOLID;
    const int pieces = cv::connectedComponentsWithStats(solid, label, stats,
                                                        centre, 8);
    std::vector<uchar> keep((size_t)pieces, 0);
    const int *piece = label.ptr<int>();

    for (int i = 1; i < pieces; i++)
        if (stats.at<int>(i, cv::CC_STAT_AREA) >= N * N / ISLANDS_LARGE)
            keep[(size_t)i] = 255;
    away = islands_distance(mask_of_labels(label, keep));
    for (size_t i = 0; i < label.total(); i++)
        if (piece[i] && away.ptr<float>()[i] <= (float)near)
            keep[(size_t)piece[i]] = 255;
    const cv::Mat person = mask_of_labels(label, keep);
    const cv::Mat other = solid & ~person;
    cv::Mat about;
    cv::parallel_for_(cv::Range(0, 2), [&](const cv::Range &some) {
        for (int i = some.start; i < some.end; i++)
            (i ? about : away) = islands_distance(i ? other : person);
    });
    mat.setTo(0, ((about <= near / 2) & (away > near)) | (away > 4 * near));
}
