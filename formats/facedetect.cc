/* The first face of a clip, by OpenCV's Haar cascade; after it the projected
 * head says where the next one is. */
extern "C" {
#include "formats/facedetect.h"
#include "lib/base/parallel.h"
}

#include <sysexits.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/parallel/parallel_backend.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>

struct facedetect {
    cv::CascadeClassifier frontal;
};

/* The longest side a picture is searched at, and the part of its shorter one that
 * the smallest face is: for a portrait, for whatever else there may be, and for
 * people in a landscape. */
static const struct {
    double side;
    int part;
} LEVEL[] = {{240, 5}, {480, 12}, {960, 24}};

/* Windows of the cascade that agree on a face.  A large upright one has 20 and
 * more in 171 of 172 portraits, and is not found in the other; what passes for one
 * in them turned by quarters has at most 14 (tests/unit/face_upright.c). */
static const int WINDOWS = 4, WINDOWS_CERTAIN = 17;

/* From $SPID_CASCADES or where packages put them; tried lists the places. */
static bool facedetect_cascade_load(cv::CascadeClassifier &c, const char *name,
                                    std::string &tried)
{
    const char *own = std::getenv("SPID_CASCADES");
    const std::string places[] = {
        own ? own : "", "/usr/share/opencv4/haarcascades",
        "/usr/share/opencv/haarcascades",
        "/usr/local/share/opencv4/haarcascades",
    };

    for (const std::string &p : places) {
        if (p.empty())
            continue;
        std::string path = p + "/" + name;
        tried += (tried.empty() ? "" : ", ") + path;
        if (FILE *fp = std::fopen(path.c_str(), "r")) {
            std::fclose(fp);
            if (c.load(path))
                return true;
        }
    }
    return false;
}

/* OpenCV's loops on our threads.  A pool of its own would take 2 MB of a live
 * driver's memory and processors that -j did not give. */
class facedetect_threads : public cv::parallel::ParallelForAPI {
public:
    void parallel_for(int n, FN_parallel_for_body_cb_t run, void *ctx) override
    {
        struct call { FN_parallel_for_body_cb_t run; void *ctx; } c = {run, ctx};

        ::parallel_for((size_t)n, 1, [](void *call_, size_t i) {
            const struct call *own = static_cast<struct call *>(call_);

            own->run((int)i, (int)i + 1, own->ctx);
        }, &c);
    }
    int getThreadNum() const override { return (int)parallel_slot(); }
    int getNumThreads() const override { return parallel_width(); }
    int setNumThreads(int) override { return parallel_width(); }
    const char *getName() const override { return "spid"; }
};

struct facedetect *facedetect_open(struct error *err)
{
    static std::once_flag once;
    facedetect *d = nullptr;

    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    try {
        std::call_once(once, [] {
            cv::parallel::setParallelForBackend(
                std::make_shared<facedetect_threads>(), false);
        });
        std::string tried;
        d = new facedetect;
        if (facedetect_cascade_load(d->frontal,
                                    "haarcascade_frontalface_alt2.xml", tried))
            return d;
        error_set(err, EX_UNAVAILABLE, "no face detector (install "
                  "opencv-data, or give --crop X,Y,SIZE; tried %s)",
                  tried.c_str());
    } catch (const std::exception &e) {
        error_set(err, EX_UNAVAILABLE, "face detector: %s", e.what());
    }
    delete d;
    return nullptr;
}

void facedetect_close(struct facedetect *d)
{
    delete d;
}

/* Faces no smaller than a `part`-th of the shorter side, the largest first. */
static std::vector<cv::Rect> facedetect_search(cv::CascadeClassifier &c,
                                               const cv::Mat &grey, int part,
                                               bool certain)
{
    std::vector<cv::Rect> found;
    std::vector<int> windows;
    int min = std::max(24, std::min(grey.cols, grey.rows) / part);

    if (c.empty() || grey.cols < min || grey.rows < min)
        return found;
    c.detectMultiScale(grey, found, windows, 1.1, WINDOWS, 0,
                       cv::Size(min, min));
    if (certain && std::none_of(windows.begin(), windows.end(), [](int n) {
            return n >= WINDOWS_CERTAIN;
        }))
        found.clear();
    /* threads find them in any order */
    std::sort(found.begin(), found.end(),
              [](const cv::Rect &a, const cv::Rect &b) {
                  return std::make_tuple(-a.area(), a.y, a.x) <
                         std::make_tuple(-b.area(), b.y, b.x);
              });
    return found;
}

/* The picture in grey with its longest side at most `side`; returns the
 * scale. */
static double facedetect_shrink_grey(cv::Mat &grey, struct mipmap *picture,
                                     double side)
{
    const struct mipmap_level *l = picture->level;
    size_t level = 0;

    /* cv::resize of the picture would take longer than the search */
    while (level + 1 < picture->levels &&
           (double)std::max(l[level].W, l[level].H) >= 4 * side)
        level++;
    l = mipmap_whole(picture, level);
    cv::Mat small((int)l->H, (int)l->W, CV_8UC3, const_cast<uint8_t *>(l->rgb));
    const double k = std::min(1.0, side / std::max(small.cols, small.rows));

    if (k < 1)
        cv::resize(small, small, cv::Size(), k, k, cv::INTER_AREA);
    cv::cvtColor(small, grey, cv::COLOR_RGB2GRAY);
    cv::equalizeHist(grey, grey);
    return (double)grey.cols / (double)picture->level->W;
}

size_t facedetect_find(struct facedetect *d, struct square *face, size_t max,
                       enum facedetect_size size, bool certain,
                       struct mipmap *picture)
{
    const int last = std::max<int>(size, FACEDETECT_ALL);
    size_t n = 0;

    try {
        cv::Mat grey;
        std::vector<cv::Rect> found;
        double k = 1;
        for (int i = size; i <= last && found.empty(); i++) {
            k = facedetect_shrink_grey(grey, picture, LEVEL[i].side);
            found = facedetect_search(d->frontal, grey, LEVEL[i].part, certain);
        }
        for (const cv::Rect &box : found) {
            if (n == max)
                break;
            face[n].x = (box.x + box.width / 2.0) / k;
            face[n].y = (box.y + box.height / 2.0) / k;
            face[n++].size = std::max(box.width, box.height) / k;
        }
    } catch (const std::exception &) {
    }
    return n;
}
