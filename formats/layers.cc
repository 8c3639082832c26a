/* A picture's two layers (layers.h), with OpenCV's filters: the background
 * filled in from beyond the person, the matte's border unmixed. */
extern "C" {
#include "formats/layers.h"
#include "formats/layers_islands.h"
}
#include "formats/layers_parts.hh"
#include "formats/mask.hh"

#include <sysexits.h>

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>

/* Inpainting works at this side at most: its cost grows with hole and reach. */
static const int LAYERS_SMALL = 112;
/* A matte of more is whole: nothing is known of the background. */
static const float LAYERS_WHOLE = 0.98f;
/* A background may be off by so many levels for the sum's sake. */
static const float LAYERS_GHOST = 16;
/* Rows that one thread takes at a time. */
static const int LAYERS_BAND = 128;

/* How many times smaller a picture may be for its mean over such a reach. */
static int layers_coarseness(double reach)
{
    int k = 1;

    while (reach / (2 * k) >= 4)
        k *= 2;
    return k;
}

/* Rows of both: colour of n channels times known, and known itself. */
template <int n>
static void layers_weigh(cv::Mat &both, const cv::Mat &colour,
                         const cv::Mat &known, const cv::Range &rows)
{
    for (int y = rows.start; y < rows.end; y++) {
        const float *c = colour.ptr<float>(y), *k = known.ptr<float>(y);
        float *to = both.ptr<float>(y);

        for (int x = 0; x < colour.cols; x++, c += n, to += n + 1) {
            for (int i = 0; i < n; i++)
                to[i] = c[i] * k[x];
            to[n] = k[x];
        }
    }
}

/* The reverse: n channels over the last one, which is weight. */
template <int n>
static void layers_unweigh(cv::Mat &mean, cv::Mat &weight, const cv::Mat &both,
                           const cv::Range &rows)
{
    for (int y = rows.start; y < rows.end; y++) {
        const float *from = both.ptr<float>(y);
        float *to = mean.ptr<float>(y), *w = weight.ptr<float>(y);

        for (int x = 0; x < both.cols; x++, from += n + 1, to += n) {
            const float least = std::max(from[n], 1e-6f);
            for (int i = 0; i < n; i++)
                to[i] = from[i] / least;
            w[x] = from[n];
        }
    }
}

/* A Gaussian's mean; bands see their neighbours' rows. */
static cv::Mat layers_blur(const cv::Mat &in, double sigma)
{
    cv::Mat out(in.size(), in.type());

    layers_each_band(in.rows, LAYERS_BAND, [&](const cv::Range &rows) {
        cv::Mat part = out.rowRange(rows);
        cv::GaussianBlur(in.rowRange(rows), part, cv::Size(), sigma);
    });
    return out;
}

cv::Mat layers_mean(cv::Mat &weight, const cv::Mat &colour,
                    const cv::Mat &known, double reach)
{
    const int k = layers_coarseness(reach);
    const cv::Size small((colour.cols + k - 1) / k, (colour.rows + k - 1) / k);
    const bool grey = colour.channels() == 1;
    cv::Mat both(colour.size(), grey ? CV_32FC2 : CV_32FC4), less;
    cv::Mat mean(colour.size(), colour.type());

    weight.create(colour.size(), CV_32F);
    layers_each_band(colour.rows, LAYERS_BAND, [&](const cv::Range &rows) {
        grey ? layers_weigh<1>(both, colour, known, rows)
             : layers_weigh<3>(both, colour, known, rows);
    });
    if (k > 1) {
        cv::resize(both, less, small, 0, 0, cv::INTER_AREA);
        cv::resize(layers_blur(less, reach / k), both, colour.size(), 0, 0,
                   cv::INTER_LINEAR);
    } else {
        both = layers_blur(both, reach);
    }
    layers_each_band(colour.rows, LAYERS_BAND, [&](const cv::Range &rows) {
        grey ? layers_unweigh<1>(mean, weight, both, rows)
             : layers_unweigh<3>(mean, weight, both, rows);
    });
    return mean;
}

/* rgb at a small size, and of which of its pixels the background is known. */
static cv::Mat layers_shrink(cv::Mat &unknown, const cv::Mat &rgb,
                             const cv::Mat &hole, int w)
{
    cv::Mat small, some, known = rgb.clone();

    known.setTo(cv::Scalar(0, 0, 0), hole);
    cv::resize(known, small, cv::Size(w, w), 0, 0, cv::INTER_AREA);
    cv::resize(hole, some, cv::Size(w, w), 0, 0, cv::INTER_AREA);
    unknown = some > 0;
    return small;
}

/* The hole filled from its surroundings, smooth. */
static cv::Mat layers_inpaint(const cv::Mat &rgb, const cv::Mat &hole)
{
    const int n = rgb.rows, w = std::min(n, LAYERS_SMALL);
    cv::Mat unknown, filled, blur, soft, big;
    cv::Mat small = layers_shrink(unknown, rgb, hole, w);

    if (cv::countNonZero(unknown) == w * w)
        return cv::Mat(n, n, CV_8UC3, cv::mean(rgb));
    /* OpenCV neither fills a picture's outermost pixels nor starts from them */
    for (cv::Mat *m : {&small, &unknown})
        cv::copyMakeBorder(*m, *m, 1, 1, 1, 1, cv::BORDER_REPLICATE);
    cv::inpaint(small, unknown, filled, w / 20.0, cv::INPAINT_TELEA);
    filled = filled(cv::Rect(1, 1, w, w)).clone();
    unknown = unknown(cv::Rect(1, 1, w, w)).clone();
    cv::GaussianBlur(filled, blur, cv::Size(), w / 40.0);
    blur.copyTo(filled, unknown);
    cv::resize(filled, big, cv::Size(n, n), 0, 0, cv::INTER_CUBIC);
    return big;
}

/* What the filled picture is off by at the hole's edge goes into it, less
 * and less, from fine to coarse. */
static void layers_spread_error(cv::Mat &fill, const cv::Mat &colour,
                                const cv::Mat &known)
{
    for (double reach = fill.rows / 256.0; reach <= fill.rows / 16.0;
         reach *= 4) {
        cv::Mat weight, three;
        cv::Mat off = layers_mean(weight, colour - fill, known, reach);
        cv::cvtColor(cv::min(weight * 2, 1.0), three, cv::COLOR_GRAY2BGR);
        fill += off.mul(three);
    }
}

/* Background of colour (float, 0..255): as seen where `seen` is not 0,
 * elsewhere as filled says, without a seam. */
static cv::Mat layers_background(const cv::Mat &rgb, const cv::Mat &seen,
                                 const cv::Mat &filled)
{
    cv::Mat colour, fill, known;

    rgb.convertTo(colour, CV_32F);
    filled.convertTo(fill, CV_32F);
    seen.convertTo(known, CV_32F, 1 / 255.0);
    layers_spread_error(fill, colour, known);
    colour.copyTo(fill, seen);
    return fill;
}

cv::Mat layers_inside(const uint8_t *inside, int n)
{
    return inside ? cv::Mat(n, n, CV_8U, const_cast<uint8_t *>(inside)) > 0
                  : cv::Mat(n, n, CV_8U, cv::Scalar(255));
}

int layers_fill(uint8_t *back, const uint8_t *rgb, const uint8_t *matte,
                const uint8_t *inside, size_t n, struct error *err)
{
    try {
        const int N = (int)n;
        cv::Mat out(N, N, CV_8UC3, back), wide;
        const cv::Mat pic(N, N, CV_8UC3, const_cast<uint8_t *>(rgb));
        const cv::Mat mat(N, N, CV_8U, const_cast<uint8_t *>(matte));
        const cv::Mat in = layers_inside(inside, N);
        cv::dilate(mat > 0, wide, mask_disc(std::max(3, N / 64)));
        layers_background(pic, (mat == 0) & in,
                          layers_inpaint(pic, (wide != 0) | (in == 0)))
            .convertTo(out, CV_8U);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "background: %s", e.what());
    }
}

float layers_share(float *share, const cv::Vec3f &pixel,
                   const cv::Vec3f &back, const cv::Vec3f &fore)
{
    const cv::Vec3f line = fore - back;
    const double length = cv::norm(line), alike = 24;

    *share = 0;
    if (length < 1e-3)
        return 0;
    const double t = (pixel - back).dot(line) / (length * length);
    const double in = std::clamp(t, 0.0, 1.0);
    const double off = cv::norm(pixel - back - (float)in * line) / length;
    *share = (float)in;
    /* full trust within a fifth of the way, none beyond two fifths */
    return (float)(std::clamp(2 - 5 * off, 0.0, 1.0)
                   * std::clamp(length / alike - 1, 0.0, 1.0));
}

/* The matte within `rim` pixels of its outline, from the colours to both
 * sides.  Inside it a pixel that is half background loses that half; outside,
 * what is clearly of the person's colour (a wisp of hair) is gained, less the
 * further out it is. */
static void layers_unmix(cv::Mat &mat, const cv::Mat &colour,
                         const cv::Mat &back, const cv::Mat &in, int rim)
{
    cv::Mat inner, outer, known, weight, far;

    /* where the picture ends is no border of the person's */
    cv::erode((mat > 127) | (in == 0), inner, mask_disc(2 * rim));
    cv::dilate(mat > 127, outer, mask_disc(2 * rim));
    cv::distanceTransform(mat <= 127, far, cv::DIST_L2, 3);
    cv::Mat own = inner & in;
    own.convertTo(known, CV_32F, 1 / 255.0);
    const cv::Mat fore = layers_mean(weight, colour, known, rim);
    for (int y = 0; y < mat.rows; y++)
        for (int x = 0; x < mat.cols; x++) {
            if (inner.at<uchar>(y, x) || !outer.at<uchar>(y, x)
                || !in.at<uchar>(y, x) || weight.at<float>(y, x) < 1e-3f)
                continue;
            float share, m = (float)mat.at<uchar>(y, x) / 255;
            const float trust = layers_share(&share,
                                             colour.at<cv::Vec3f>(y, x),
                                             back.at<cv::Vec3f>(y, x),
                                             fore.at<cv::Vec3f>(y, x));
            const float away = far.at<float>(y, x) / (float)rim;
            /* faint likeness is noise, and more so far out */
            float gain = std::clamp((share - 0.05f - 0.15f * away) * 1.3f,
                                    0.0f, 1.0f);
            float want = away > 0 ? std::max(std::min(m, 2 * share), gain)
                                  : std::min(m, 2 * share);
            m += trust * (want - m);
            mat.at<uchar>(y, x) = cv::saturate_cast<uchar>(255 * m);
        }
}

/* How far a picture's colours are from the background's about them (away,
 * float), expected; returns where that is more than the background varies. */
static cv::Mat layers_strange(cv::Mat &expected, cv::Mat &away,
                              const cv::Mat &colour, const cv::Mat &sure)
{
    cv::Mat known, weight, off, plane[3], usual;

    sure.convertTo(known, CV_32F, 1 / 255.0);
    expected = layers_mean(weight, colour, known, colour.rows / 48.0);
    cv::absdiff(colour, expected, off);
    cv::split(off, plane);
    cv::max(plane[0], cv::max(plane[1], plane[2]), away);
    usual = layers_mean(weight, away, known, colour.rows / 24.0);
    return (away > cv::max(usual * 4, 20.0)) & (weight > 1e-3);
}

/* Of these, what is thin and hangs together with the person. */
static cv::Mat layers_attached(const cv::Mat &strange, const cv::Mat &person)
{
    const int n = person.rows;
    cv::Mat wide, far, label;

    cv::morphologyEx(strange & ~person, wide, cv::MORPH_OPEN,
                     mask_disc(std::max(5, n / 40)));
    cv::distanceTransform(~person, far, cv::DIST_L2, 5);
    const cv::Mat thin = (strange & ~wide & (far <= n / 8)) | person;
    const int count = cv::connectedComponents(thin, label, 8);
    return mask_of_labels(label, mask_touched(label, count, person))
           & ~person;
}

/* The locks' colours without the background's share: as the strangest of
 * their pixels have them. */
static cv::Mat layers_lock_colour(const cv::Mat &colour, const cv::Mat &away,
                                  const cv::Mat &locks)
{
    cv::Mat weight, known;

    cv::pow(away / 255, 4, known);
    known.setTo(0, locks == 0);
    return layers_mean(weight, colour, known * 1e3, colour.rows / 128.0);
}

/* A matte of locks that hang away from the head, beyond its rim: what before a
 * background of little change is of another colour, thin, and hangs together
 * with the person.  sure loses what they cover. */
static cv::Mat layers_locks(cv::Mat &sure, const cv::Mat &mat,
                            const cv::Mat &colour, const cv::Mat &in, int rim)
{
    cv::Mat expected, away, hidden, near, out(mat.size(), CV_8U, cv::Scalar(0));
    const cv::Mat person = mat > 127;
    /* twice: what looked strange is no measure of the background */
    cv::Mat strange = layers_strange(expected, away, colour, sure) & in;
    cv::dilate(strange, hidden, mask_disc(3));
    strange = layers_strange(expected, away, colour, sure & ~hidden) & in;
    const cv::Mat locks = layers_attached(strange, person);
    if (cv::countNonZero(locks) == 0)
        return out;
    cv::dilate(locks, hidden, mask_disc(5));
    sure &= ~hidden;
    cv::dilate(person, near, mask_disc(2 * rim));
    hidden &= in & ~near;
    const cv::Mat fore = layers_lock_colour(colour, away, locks);
    for (int y = 0; y < mat.rows; y++)
        for (int x = 0; x < mat.cols; x++) {
            if (!hidden.at<uchar>(y, x))
                continue;
            float share;
            layers_share(&share, colour.at<cv::Vec3f>(y, x),
                         expected.at<cv::Vec3f>(y, x),
                         fore.at<cv::Vec3f>(y, x));
            out.at<uchar>(y, x) = cv::saturate_cast<uchar>(
                255 * std::clamp((share - 0.05f) * 1.1f, 0.0f, 1.0f));
        }
    return out;
}

/* The least matte by which a pixel can be a mixture of this background and of
 * some colour. */
static float layers_min_matte(const cv::Vec3f &pixel, const cv::Vec3f &back)
{
    float least = 0;

    for (int c = 0; c < 3; c++) {
        const float d = pixel[c] - back[c];
        const float room = d > 0 ? 255 - back[c] : back[c];
        least = std::max(least, std::abs(d) / std::max(room, 1.0f));
    }
    return std::min(least, 1.0f);
}

/* The background where a pixel of such a matte is the sum of both, and the
 * person's colour is in range. */
static cv::Vec3f layers_behind(const cv::Vec3f &pixel, const cv::Vec3f &back,
                               float m)
{
    cv::Vec3f out;

    for (int c = 0; c < 3; c++) {
        const float p = std::clamp(pixel[c] - (1 - m) * back[c], 0.0f,
                                   255 * m);
        out[c] = std::clamp((pixel[c] - p) / (1 - m), 0.0f, 255.0f);
    }
    return out;
}

void layers_balance(cv::Mat &back, cv::Mat &mat, const cv::Mat &colour)
{
    for (int y = 0; y < mat.rows; y++)
        for (int x = 0; x < mat.cols; x++) {
            const cv::Vec3f &pixel = colour.at<cv::Vec3f>(y, x);
            cv::Vec3f &b = back.at<cv::Vec3f>(y, x);
            float m = (float)mat.at<uchar>(y, x) / 255;
            if (m <= 0 || m > LAYERS_WHOLE)
                continue;
            const cv::Vec3f want = layers_behind(pixel, b, m);
            if (cv::norm(want - b, cv::NORM_INF) < LAYERS_GHOST) {
                b = want;
                continue;
            }
            mat.at<uchar>(y, x) = cv::saturate_cast<uchar>(
                255 * std::max(m, 1.2f * layers_min_matte(pixel, b)));
            m = (float)mat.at<uchar>(y, x) / 255;
            if (m <= LAYERS_WHOLE)
                b = layers_behind(pixel, b, m);
        }
}

int layers_split(uint8_t *matte, uint8_t *back, uint8_t *rgb,
                 const uint8_t *inside, size_t n, struct error *err)
{
    try {
        const int N = (int)n, rim = std::max(2, N / 64);
        cv::Mat pic(N, N, CV_8UC3, rgb), mat(N, N, CV_8U, matte);
        cv::Mat out(N, N, CV_8UC3, back), colour, wide;
        const cv::Mat in = layers_inside(inside, N);
        pic.convertTo(colour, CV_32F);
        /* the background as beyond all doubt, then up to the matte's edge */
        cv::dilate(mat > 8, wide, mask_disc(2 * rim));
        cv::Mat sure = (wide == 0) & in;
        const cv::Mat locks = layers_locks(sure, mat, colour, in, rim);
        const cv::Mat filled = layers_inpaint(pic, sure == 0);
        layers_unmix(mat, colour, layers_background(pic, sure, filled), in,
                     rim);
        cv::max(mat, locks, mat);
        layers_gather(mat, pic, in);
        layers_islands(matte, n);
        cv::Mat fill = layers_background(pic, (mat == 0) & in, filled);
        fill.convertTo(out, CV_8U);
        out.copyTo(pic, in == 0);
        pic.convertTo(colour, CV_32F);
        layers_balance(fill, mat, colour);
        fill.convertTo(out, CV_8U);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}
