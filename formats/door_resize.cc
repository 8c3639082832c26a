/* Pictures at another size, by OpenCV. */
extern "C" {
#include "formats/door.h"
}

#include <sysexits.h>

#include <opencv2/imgproc.hpp>

extern "C" int door_resize(uint8_t *out, size_t W, size_t H,
                           const uint8_t *rgb, size_t width, size_t height,
                           int channels, struct error *err)
{
    try {
        const int type = CV_MAKETYPE(CV_8U, channels);
        const cv::Mat from((int)height, (int)width, type, (void *)rgb);
        cv::Mat to((int)H, (int)W, type, out);

        cv::resize(from, to, to.size(), 0, 0, cv::INTER_CUBIC);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_OSERR, "cannot resize a picture: %s",
                         e.what());
    }
}
