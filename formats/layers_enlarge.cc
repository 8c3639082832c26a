/* A picture's two layers at its own size, from those at the networks'
 * (layers.h). */
extern "C" {
#include "formats/layers.h"
#include "formats/layers_islands.h"
}
#include "formats/layers_parts.hh"
#include "formats/mask.hh"

#include <sysexits.h>

#include <algorithm>

#include <opencv2/imgproc.hpp>

/* Rows whose floats fit into a cache. */
static const int LAYERS_CACHED = 32;

static cv::Mat layers_up(const cv::Mat &small, int n)
{
    cv::Mat big;

    cv::resize(small, big, cv::Size(n, n), 0, 0, cv::INTER_LINEAR);
    return big;
}

/* The person's colours about each pixel of the small picture, and how many
 * there are. */
static cv::Mat layers_foreground(cv::Mat &weight, const cv::Mat &rgb,
                                 const cv::Mat &mat)
{
    const int rim = std::max(2, rgb.rows / 64);
    cv::Mat own, known, colour;

    cv::erode(mat > 250, own, mask_disc(rim));
    own.convertTo(known, CV_32F, 1 / 255.0);
    rgb.convertTo(colour, CV_32F);
    return layers_mean(weight, colour, known, rim);
}

/* A matte that was enlarged, where it is neither 0 nor whole: what the finer
 * colours say, as far as they can be told apart. */
static void layers_sharpen(cv::Mat &mat, const cv::Mat &colour,
                           const cv::Mat &back, const cv::Mat &fore,
                           const cv::Mat &weight)
{
    for (int y = 0; y < mat.rows; y++)
        for (int x = 0; x < mat.cols; x++) {
            uchar &m = mat.at<uchar>(y, x);
            if (m == 0 || m == 255 || weight.at<float>(y, x) < 1e-3f)
                continue;
            float share;
            const float trust = layers_share(&share,
                                             colour.at<cv::Vec3f>(y, x),
                                             back.at<cv::Vec3f>(y, x),
                                             fore.at<cv::Vec3f>(y, x));
            const float want = std::clamp((share - 0.05f) * 1.1f, 0.0f, 1.0f);
            m = cv::saturate_cast<uchar>(m + trust * (255 * want - m));
        }
}

/* A matte that was guessed at the small picture's size, as the larger one's
 * colours have it. */
static void layers_enlarge_matte(cv::Mat &mat, const cv::Mat &mat_s,
                                 const cv::Mat &pic, const cv::Mat &small,
                                 const cv::Mat &rear, const cv::Mat &in)
{
    const int n = mat.rows;
    cv::Mat weight_s;
    const cv::Mat fore_s = layers_foreground(weight_s, small, mat_s);
    const cv::Mat fore = layers_up(fore_s, n), weight = layers_up(weight_s, n);

    layers_up(mat_s, n).copyTo(mat);
    layers_each_band(n, LAYERS_CACHED, [&](const cv::Range &rows) {
        cv::Mat part = mat.rowRange(rows), colour, behind;
        pic.rowRange(rows).convertTo(colour, CV_32F);
        rear.rowRange(rows).convertTo(behind, CV_32F);
        layers_sharpen(part, colour, behind, fore.rowRange(rows),
                       weight.rowRange(rows));
    });
    layers_gather(mat, pic, in);
    layers_islands(mat.data, (size_t)n);
}

/* rear, enlarged, becomes the background: as the picture where there is no
 * matte, and elsewhere such that the sum is right. */
static void layers_balance_enlarged(cv::Mat &rear, cv::Mat &mat,
                                    const cv::Mat &pic)
{
    layers_each_band(mat.rows, LAYERS_CACHED, [&](const cv::Range &rows) {
        cv::Mat part = mat.rowRange(rows), out = rear.rowRange(rows);
        cv::Mat colour, behind;
        pic.rowRange(rows).convertTo(colour, CV_32F);
        out.convertTo(behind, CV_32F);
        colour.copyTo(behind, part == 0);
        layers_balance(behind, part, colour);
        behind.convertTo(out, CV_8U);
    });
}

int layers_enlarge(uint8_t *matte, uint8_t *back, uint8_t *rgb, size_t n,
                   const uint8_t *matte_s, const uint8_t *back_s,
                   const uint8_t *rgb_s, size_t s, const uint8_t *inside,
                   bool known, struct error *err)
{
    try {
        const int N = (int)n, S = (int)s;
        const cv::Mat small(S, S, CV_8UC3, const_cast<uint8_t *>(rgb_s));
        const cv::Mat mat_s(S, S, CV_8U, const_cast<uint8_t *>(matte_s));
        const cv::Mat rear(S, S, CV_8UC3, const_cast<uint8_t *>(back_s));
        const cv::Mat in = layers_inside(inside, N), out = in == 0;
        cv::Mat pic(N, N, CV_8UC3, rgb), mat(N, N, CV_8U, matte);
        cv::Mat fill(N, N, CV_8UC3, back);
        layers_up(small, N).copyTo(pic, out);
        layers_up(rear, N).copyTo(fill);
        if (known)
            layers_up(mat_s, N).copyTo(mat, out);
        else
            layers_enlarge_matte(mat, mat_s, pic, small, fill, in);
        layers_balance_enlarged(fill, mat, pic);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}
