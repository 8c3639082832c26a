/* Cameras by OpenCV: frames that come when they come. */
extern "C" {
#include "formats/media/camera.h"
}

#include <sysexits.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

struct camera : video_reader {
    cv::VideoCapture capture;
    cv::Mat bgr, rgb;
    std::string path;
    size_t count = 0;
};

/* A camera by its number or device. */
static bool camera_capture(camera *c, const char *path)
{
    if (*path == '/' ? !c->capture.open(path, cv::CAP_V4L2)
                     : !c->capture.open(std::atoi(path + 7)))
        return false;
    c->capture.set(cv::CAP_PROP_BUFFERSIZE, 1);     /* the newest frame */
    return true;
}

/* As video_read; a camera that sends nothing has ended, with what was seen
 * last. */
static int camera_read(struct video_reader *v, const uint8_t **rgb,
                       size_t *width, size_t *height, double *time,
                       struct error *err)
{
    camera *c = static_cast<camera *>(v);

    try {
        if (!c->capture.grab() || !c->capture.retrieve(c->bgr)
            || c->bgr.empty())
            return 0;
        if (c->bgr.type() != CV_8UC3)
            return error_set(err, EX_DATAERR, "%s: frame %zu: not 8-bit "
                             "colour", c->path.c_str(), c->count);
        cv::cvtColor(c->bgr, c->rgb, cv::COLOR_BGR2RGB);
        double t = c->capture.get(cv::CAP_PROP_POS_MSEC) / 1000;
        double step = 1 / (c->rate > 0 ? c->rate : 25);
        /* times must grow; some give none */
        if (!(t > c->end) || !std::isfinite(t))
            t = c->end < 0 ? 0 : c->end + step;
        c->end = t;
        c->count++;
        *rgb = c->rgb.data;
        *width = (size_t)c->rgb.cols;
        *height = (size_t)c->rgb.rows;
        *time = t;
        return 1;
    } catch (const std::exception &e) {
        return error_set(err, EX_DATAERR, "%s: frame %zu: %s",
                         c->path.c_str(), c->count, e.what());
    }
}

static void camera_close(struct video_reader *v)
{
    delete static_cast<camera *>(v);
}

static const struct video_reading camera_functions = {
    camera_read, camera_close
};

struct video_reader *camera_open(const char *path, struct error *err)
{
    camera *c = nullptr;

    /* OpenCV prints what it thinks; our messages say it instead */
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    try {
        c = new camera();
        c->by = &camera_functions;
        c->end = -1;
        c->path = path;
        if (camera_capture(c, path)) {
            double rate = c->capture.get(cv::CAP_PROP_FPS);

            c->rate = rate > 0 && rate < 100000 ? rate : 0;
            return c;
        }
        error_set(err, EX_DATAERR, "%s: not a camera that can be read", path);
    } catch (const std::exception &e) {
        error_set(err, EX_DATAERR, "%s: %s", path, e.what());
    }
    delete c;
    return nullptr;
}
