extern "C" {
#include "formats/video.h"
}

#include <sys/stat.h>
#include <sysexits.h>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

/* OpenCV and ffmpeg print what they think; our messages say it instead. */
static void hush()
{
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
}

struct video_reader {
    cv::VideoCapture capture;
    cv::Mat bgr, rgb;
    std::string path;
    double rate = 0, last = -1;
    size_t frames = 0, count = 0;
    bool live = false;
};

static bool open_capture(video_reader *v, const char *path)
{
    if (std::strncmp(path, "camera:", 7) == 0) {
        v->live = true;
        return v->capture.open(std::atoi(path + 7));
    }
    return v->capture.open(path, cv::CAP_FFMPEG);
}

struct video_reader *video_open(const char *path, struct error *err)
{
    struct stat st;
    video_reader *v = nullptr;

    hush();
    if (std::strncmp(path, "camera:", 7) != 0 && stat(path, &st) != 0) {
        error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                  std::strerror(errno));
        return nullptr;
    }
    try {
        v = new video_reader;
        v->path = path;
        if (!open_capture(v, path)) {
            delete v;
            error_set(err, EX_DATAERR, "%s: not a video or picture that can "
                      "be decoded", path);
            return nullptr;
        }
        double rate = v->capture.get(cv::CAP_PROP_FPS);
        double n = v->capture.get(cv::CAP_PROP_FRAME_COUNT);
        v->rate = rate > 0 && rate < 100000 ? rate : 0;
        v->frames = n > 0 && n < 1e12 && !v->live ? (size_t)n : 0;
        return v;
    } catch (const std::exception &e) {
        delete v;
        error_set(err, EX_DATAERR, "%s: %s", path, e.what());
        return nullptr;
    }
}

double video_rate(const struct video_reader *v)
{
    return v->rate;
}

size_t video_frames(const struct video_reader *v)
{
    return v->frames;
}

int video_read(struct video_reader *v, const uint8_t **rgb, size_t *width,
               size_t *height, double *time, struct error *err)
{
    try {
        if (!v->capture.grab() || !v->capture.retrieve(v->bgr)
            || v->bgr.empty())
            return 0;
        if (v->bgr.type() != CV_8UC3)
            return error_set(err, EX_DATAERR, "%s: frame %zu: not 8-bit "
                             "colour", v->path.c_str(), v->count);
        cv::cvtColor(v->bgr, v->rgb, cv::COLOR_BGR2RGB);
        double t = v->capture.get(cv::CAP_PROP_POS_MSEC) / 1000;
        double step = 1 / (v->rate > 0 ? v->rate : 25);
        /* times must grow; some containers give none */
        if (!(t > v->last) || !std::isfinite(t))
            t = v->last < 0 ? 0 : v->last + step;
        v->last = t;
        v->count++;
        *rgb = v->rgb.data;
        *width = (size_t)v->rgb.cols;
        *height = (size_t)v->rgb.rows;
        *time = t;
        return 1;
    } catch (const std::exception &e) {
        return error_set(err, EX_DATAERR, "%s: frame %zu: %s",
                         v->path.c_str(), v->count, e.what());
    }
}

void video_close(struct video_reader *v)
{
    delete v;
}

/* ---- writing ---------------------------------------------------------- */

struct video_writer {
    cv::VideoWriter writer;
    cv::Mat bgr;
    std::string path;
    size_t width = 0, height = 0, count = 0;
};

static bool open_writer(video_writer *v, double rate)
{
    const int code[] = {
        cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
        cv::VideoWriter::fourcc('V', 'P', '9', '0'),
        cv::VideoWriter::fourcc('m', 'p', '4', 'v'),
    };
    const bool webm = v->path.size() > 5
        && v->path.compare(v->path.size() - 5, 5, ".webm") == 0;

    for (int i = webm ? 1 : 0; i < 3; i++) {
        if (i == 1 && !webm)
            continue;
        if (v->writer.open(v->path, cv::CAP_FFMPEG, code[i], rate,
                           v->bgr.size(), true))
            return true;
    }
    return false;
}

struct video_writer *video_create(const char *path, size_t width,
                                  size_t height, double rate,
                                  struct error *err)
{
    video_writer *v = nullptr;

    hush();
    try {
        v = new video_writer;
        v->path = path;
        v->width = width;
        v->height = height;
        v->bgr.create((int)(height + height % 2), (int)(width + width % 2),
                      CV_8UC3);
        if (!open_writer(v, rate)) {
            delete v;
            error_set(err, EX_CANTCREAT, "%s: cannot create a video (no "
                      "encoder, or the directory cannot be written)", path);
            return nullptr;
        }
        return v;
    } catch (const std::exception &e) {
        delete v;
        error_set(err, EX_CANTCREAT, "%s: %s", path, e.what());
        return nullptr;
    }
}

int video_write(struct video_writer *v, const uint8_t *rgb, struct error *err)
{
    try {
        cv::Mat in((int)v->height, (int)v->width, CV_8UC3,
                   const_cast<uint8_t *>(rgb));
        if (v->bgr.size() == in.size()) {
            cv::cvtColor(in, v->bgr, cv::COLOR_RGB2BGR);
        } else {
            cv::Mat t;
            cv::cvtColor(in, t, cv::COLOR_RGB2BGR);
            cv::copyMakeBorder(t, v->bgr, 0, v->bgr.rows - in.rows, 0,
                               v->bgr.cols - in.cols, cv::BORDER_REPLICATE);
        }
        v->writer.write(v->bgr);
        v->count++;
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_IOERR, "%s: frame %zu: %s", v->path.c_str(),
                         v->count, e.what());
    }
}

/* The writer does not tell when the disk is full: look at what arrived. */
int video_finish(struct video_writer *v, struct error *err)
{
    int rc = 0;

    try {
        v->writer.release();
        cv::VideoCapture back(v->path, cv::CAP_FFMPEG);
        double n = back.isOpened() ? back.get(cv::CAP_PROP_FRAME_COUNT) : -1;
        if (n < 0 || (v->count > 0 && !back.grab()))
            rc = error_set(err, EX_IOERR, "%s: cannot be read back after "
                           "writing (disk full?)", v->path.c_str());
        else if (n > 0 && n + 1 < (double)v->count)
            rc = error_set(err, EX_IOERR, "%s: holds %.0f of %zu frames (disk"
                           " full?)", v->path.c_str(), n, v->count);
    } catch (const std::exception &e) {
        rc = error_set(err, EX_IOERR, "%s: %s", v->path.c_str(), e.what());
    }
    delete v;
    return rc;
}

void video_abandon(struct video_writer *v)
{
    delete v;
}
