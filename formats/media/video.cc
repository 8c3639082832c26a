/* Videos in and out by OpenCV, with the colours that the file's tags say. */
extern "C" {
#include "formats/video.h"
}

#include <sys/stat.h>
#include <sysexits.h>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

/* OpenCV and ffmpeg print what they think; our messages say it instead. */
static void opencv_hush()
{
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
}

/* ---- colours ----------------------------------------------------------- *
 * OpenCV converts with BT.601's matrix both ways, whatever the file says.
 * Files of BT.709 are put right afterwards; colours so saturated that the
 * wrong matrix cut them off (pure red or blue) stay a little off. */

/* What players take for BT.709 when the file does not say. */
static bool is_hd(int width, int height)
{
    return width >= 1280 || height > 576;
}

/* The matrix in a file's first and last megabytes: MP4 and MOV say it in a
 * "colr" box, Matroska in element 55B1; 1 is BT.709, 0 or 2 not known. */
static int tagged_matrix(const char *path)
{
    const size_t most = (size_t)4 << 20;
    std::ifstream in(path, std::ios::binary);
    std::string head(most, '\0'), tail;

    in.read(&head[0], (std::streamsize)most);
    head.resize((size_t)in.gcount());
    if (head.size() == most) {
        in.seekg(-(std::streamoff)most, std::ios::end);
        tail.resize(most);
        in.read(&tail[0], (std::streamsize)most);
        tail.resize((size_t)in.gcount());
    }
    if (head.compare(0, 4, "\x1a\x45\xdf\xa3") == 0) {
        size_t at = head.find("\x55\xb1\x81");
        return at < head.size() - 3 ? (unsigned char)head[at + 3] : 0;
    }
    if (head.compare(4, 4, "ftyp") != 0)
        return 0;
    for (const std::string *s : {&head, &tail}) {
        size_t at = s->find("colrnclx");
        if (at == std::string::npos)
            at = s->find("colrnclc");
        if (at != std::string::npos && at + 14 <= s->size())
            return (unsigned char)(*s)[at + 13];
    }
    return 0;
}

/* MPEG-TS has no index and announces nothing, but it is made of packets of 188
 * bytes that start with 0x47 (192 with a time before each in M2TS, 204 with
 * parity behind): a file that ends inside one was cut. */
static bool ends_in_packet(const char *path)
{
    static const size_t packet[3] = {188, 192, 204}, sync[3] = {0, 4, 0};
    std::ifstream in(path, std::ios::binary);
    std::string head((size_t)4 * 204, '\0');

    in.read(&head[0], (std::streamsize)head.size());
    if ((size_t)in.gcount() < head.size())
        return false;
    in.seekg(0, std::ios::end);
    for (int i = 0; i < 3; i++) {
        bool all = true;

        for (size_t at = sync[i]; at < head.size(); at += packet[i])
            all = all && head[at] == 0x47;
        if (all)
            return (size_t)in.tellg() % packet[i] != 0;
    }
    return false;
}

/* What takes RGB that one matrix (Kr, Kb) made of YCbCr to what the other
 * makes of the same. */
static cv::Matx33f matrix_between(double kr, double kb, double to_kr,
                                  double to_kb)
{
    const double kg = 1 - kr - kb, to_kg = 1 - to_kr - to_kb;
    const cv::Matx33d ycc(kr, kg, kb,
                          -kr / (2 - 2 * kb), -kg / (2 - 2 * kb), 0.5,
                          0.5, -kg / (2 - 2 * kr), -kb / (2 - 2 * kr));
    const double r = 2 - 2 * to_kr, b = 2 - 2 * to_kb;
    const cv::Matx33d rgb(1, 0, r,
                          1, -to_kb * b / to_kg, -to_kr * r / to_kg,
                          1, b, 0);

    return cv::Matx33f(rgb * ycc);
}

static const double K601[2] = {0.299, 0.114}, K709[2] = {0.2126, 0.0722};

/* ---- reading ----------------------------------------------------------- */

struct video_reader {
    cv::VideoCapture capture;
    cv::Mat bgr, rgb;
    cv::Matx33f recolour;        /* of rgb, if bt709 */
    bool bt709 = false;
    std::string path;
    double rate = 0, last = -1;
    size_t frames = 0, count = 0;
    bool live = false;
};

/* A camera by its number or device, an address, or a file. */
static bool open_capture(video_reader *v, const char *path)
{
    v->live = video_is_live(path);
    if (!video_is_camera(path))
        return v->capture.open(path, cv::CAP_FFMPEG);
    if (*path == '/' ? !v->capture.open(path, cv::CAP_V4L2)
                     : !v->capture.open(std::atoi(path + 7)))
        return false;
    v->capture.set(cv::CAP_PROP_BUFFERSIZE, 1);     /* the newest frame */
    return true;
}

/* Tags, or by size as players do; the matrix that corrects OpenCV's. */
static void find_colours(video_reader *v, bool bt601)
{
    const int m = v->live || bt601 ? 6 : tagged_matrix(v->path.c_str());

    v->bt709 = m == 1
        || ((m == 0 || m == 2)
            && is_hd((int)v->capture.get(cv::CAP_PROP_FRAME_WIDTH),
                     (int)v->capture.get(cv::CAP_PROP_FRAME_HEIGHT)));
    v->recolour = matrix_between(K601[0], K601[1], K709[0], K709[1]);
}

struct video_reader *video_open(const char *path, bool bt601,
                                struct error *err)
{
    struct stat st;
    video_reader *v = nullptr;

    opencv_hush();
    if (!video_is_live(path) && stat(path, &st) != 0) {
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
        find_colours(v, bt601);
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

bool video_cut(const struct video_reader *v)
{
    return !v->live && ends_in_packet(v->path.c_str());
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
        if (v->bt709)
            cv::transform(v->rgb, v->rgb, v->recolour);
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

/* The first codec that this machine has. */
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

    opencv_hush();
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
        /* players will take it for BT.709: written so that they are right */
        if (is_hd(v->bgr.cols, v->bgr.rows)) {
            cv::cvtColor(v->bgr, v->bgr, cv::COLOR_BGR2RGB);
            cv::transform(v->bgr, v->bgr,
                          matrix_between(K709[0], K709[1], K601[0], K601[1]));
            cv::cvtColor(v->bgr, v->bgr, cv::COLOR_RGB2BGR);
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
