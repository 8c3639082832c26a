/* Masks and their pieces (mask.hh). */
#include "formats/mask.hh"

#include <opencv2/imgproc.hpp>

cv::Mat mask_disc(int side)
{
    return cv::getStructuringElement(cv::MORPH_ELLIPSE,
                                     cv::Size(side | 1, side | 1));
}

std::vector<uchar> mask_touched(const cv::Mat &label, int labels,
                                const cv::Mat &mask)
{
    std::vector<uchar> touched((size_t)labels, 0);

    for (int y = 0; y < label.rows; y++)
        for (int x = 0; x < label.cols; x++)
            if (mask.at<uchar>(y, x))
                touched[(size_t)label.at<int>(y, x)] = 255;
    return touched;
}

cv::Mat mask_of_labels(const cv::Mat &label, const std::vector<uchar> &keep)
{
    const int *piece = label.ptr<int>();
    cv::Mat out(label.size(), CV_8U);

    for (size_t i = 0; i < label.total(); i++)
        out.data[i] = keep[(size_t)piece[i]];
    return out;
}

cv::Mat mask_piece_of_head(const cv::Mat &mask, const cv::Mat &head)
{
    cv::Mat label;
    const int labels = cv::connectedComponents(mask, label, 8);
    int best = 0, most = 0;

    for (int i = 1; i < labels; i++) {
        int in = cv::countNonZero((label == i) & head);

        if (in > most) {
            most = in;
            best = i;
        }
    }
    return best ? cv::Mat(label == best)
                : cv::Mat(cv::Mat::zeros(mask.size(), CV_8U));
}
