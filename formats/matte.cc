/* The person cut out of the source picture: GrabCut seeded by the projected
 * head (Rother et al. 2004), its border refined, and colours unmixed there. */
extern "C" {
#include "formats/matte.h"
}

#include <sysexits.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/photo.hpp>

/* GrabCut works at this side: its cost grows faster than the pixels. */
static const int WORK = 256;

/* For dilating and eroding. */
static cv::Mat brush_disc(int side)
{
    return cv::getStructuringElement(cv::MORPH_ELLIPSE,
                                     cv::Size(side | 1, side | 1));
}

/* Seeds from the head's silhouette: labels of cv::grabCut.  part: where the
 * square lies in its picture. */
static cv::Mat grabcut_seeds(const cv::Mat &head, const cv::Rect &part)
{
    const int n = head.rows;
    cv::Rect box = cv::boundingRect(head);
    const int size = std::max(box.width, box.height);
    cv::Mat label(n, n, CV_8U, cv::Scalar(cv::GC_BGD)), core, hair;

    /* hair and headgear reach about a third of the head beyond it */
    cv::dilate(head, hair, brush_disc(size * 2 / 3));
    label.setTo(cv::GC_PR_BGD, hair);
    cv::dilate(head, hair, brush_disc(size / 5));
    label.setTo(cv::GC_PR_FGD, hair);
    cv::erode(head, core, brush_disc(std::max(3, size / 12)));
    label.setTo(cv::GC_FGD, core);
    /* neck and shoulders: a widening region below the chin */
    const int chin = box.y + box.height * 3 / 4, cx = box.x + box.width / 2;
    for (int y = chin; y < n; y++) {
        int reach = box.width / 2 + (y - chin) * 2, tight = box.width / 3;
        for (int x = 0; x < n; x++) {
            uchar &l = label.at<uchar>(y, x);
            int d = std::abs(x - cx);
            if (l == cv::GC_BGD && d < reach)
                l = cv::GC_PR_FGD;
            /* nobody is without shoulders: their colours are needed */
            int below = y - (box.y + box.height * 9 / 10);
            if (below > 0 && d < std::min(tight + below, box.width * 9 / 10))
                l = cv::GC_FGD;
        }
    }
    /* the picture's borders above the shoulders show no one as long as the
     * head is away from them */
    const int margin = std::max(2, n / 64), away = n / 6;
    const int beside = std::max(0, chin - part.y);
    cv::Mat here = label(part);
    if (box.y - part.y > away)
        here.rowRange(0, std::min(margin, part.height)).setTo(cv::GC_BGD);
    cv::Mat sides = here.rowRange(0, std::min(beside, part.height));
    if (box.x - part.x > away)
        sides.colRange(0, std::min(margin, part.width)).setTo(cv::GC_BGD);
    if (part.br().x - box.br().x > away)
        sides.colRange(std::max(0, part.width - margin), part.width)
            .setTo(cv::GC_BGD);
    label.setTo(cv::GC_FGD, core);
    return label;
}

/* Keep the piece that holds the head; fill holes inside it. */
static void region_clean(cv::Mat &fg, const cv::Mat &head)
{
    cv::Mat label, stats, centres;
    int n = cv::connectedComponentsWithStats(fg, label, stats, centres, 8);
    int best = 0, most = 0;

    for (int i = 1; i < n; i++) {
        int in = cv::countNonZero((label == i) & (head > 0));
        if (in > most) {
            most = in;
            best = i;
        }
    }
    fg = label == best;
    if (best == 0)
        fg.setTo(0);
    cv::Mat bg = fg == 0;
    n = cv::connectedComponentsWithStats(bg, label, stats, centres, 4);
    for (int i = 1; i < n; i++)
        if (stats.at<int>(i, cv::CC_STAT_AREA) < fg.rows * fg.cols / 50
            && stats.at<int>(i, cv::CC_STAT_TOP) > 0
            && stats.at<int>(i, cv::CC_STAT_LEFT) > 0)
            fg.setTo(255, label == i);
}

/* Soft border that follows the picture's edges: a guided filter of the mask,
 * with the picture's luminance as guide (He et al. 2010, local lines). */
static cv::Mat border_refine(const cv::Mat &mask, const cv::Mat &rgb)
{
    const int r = std::max(3, mask.rows / 100);
    const cv::Size k(2 * r + 1, 2 * r + 1);
    cv::Mat I, p, mI, mp, mIp, mII, a, b;

    cv::cvtColor(rgb, I, cv::COLOR_RGB2GRAY);
    I.convertTo(I, CV_32F, 1 / 255.0);
    mask.convertTo(p, CV_32F, 1 / 255.0);
    cv::blur(I, mI, k);
    cv::blur(p, mp, k);
    cv::blur(I.mul(p), mIp, k);
    cv::blur(I.mul(I), mII, k);
    cv::divide(mIp - mI.mul(mp), mII - mI.mul(mI) + 1e-4, a);
    b = mp - a.mul(mI);
    cv::blur(a, a, k);
    cv::blur(b, b, k);
    cv::Mat q = a.mul(I) + b, out;
    /* only the border may be soft */
    cv::Mat inner, outer;
    cv::erode(mask, inner, brush_disc(2 * r));
    cv::dilate(mask, outer, brush_disc(2 * r));
    q = (q - 0.1) / 0.8;
    q.convertTo(out, CV_8U, 255);
    out.setTo(255, inner);
    out.setTo(0, outer == 0);
    return out;
}

/* What is used when the colours decide nothing: the head, widened. */
static void soft_disc(cv::Mat &matte, const cv::Mat &head)
{
    cv::Mat m;

    cv::dilate(head, m, brush_disc(head.rows / 12));
    cv::GaussianBlur(m, matte, cv::Size(), head.rows / 80.0);
}

int matte_grabcut(uint8_t *matte, int *fallback, const uint8_t *rgb,
                  const uint8_t *head, const uint8_t *inside, size_t n,
                  struct error *err)
{
    *fallback = 0;
    try {
        const int N = (int)n, w = std::min(N, WORK);
        cv::Mat out(N, N, CV_8U, matte);
        cv::Mat pic(N, N, CV_8UC3, const_cast<uint8_t *>(rgb));
        cv::Mat hd(N, N, CV_8U, const_cast<uint8_t *>(head));
        cv::Mat in(N, N, CV_8U, cv::Scalar(255)), bgm, fgm, small, sh, si;
        if (inside)
            std::memcpy(in.data, inside, n * n);
        cv::resize(pic, small, cv::Size(w, w), 0, 0, cv::INTER_AREA);
        cv::resize(hd, sh, cv::Size(w, w), 0, 0, cv::INTER_AREA);
        cv::resize(in, si, cv::Size(w, w), 0, 0, cv::INTER_NEAREST);
        sh = sh > 127;
        /* what lies beyond the picture's border is black, and no background
         * to learn from */
        const cv::Rect part = cv::boundingRect(si);
        if (!(part & cv::boundingRect(sh)).area())
            return error_set(err, EX_DATAERR, "the head lies outside the "
                             "picture (give --crop X,Y,SIZE or --mask FILE)");
        cv::Mat label = grabcut_seeds(sh, part)(part).clone();
        if (!cv::countNonZero((label == cv::GC_BGD)
                              | (label == cv::GC_PR_BGD))) {
            *fallback = 1;             /* nothing but the face to be seen */
            soft_disc(out, hd);
            return 0;
        }
        cv::theRNG().state = 0x5eed;
        cv::setRNGSeed(1);
        cv::grabCut(small(part).clone(), label, cv::Rect(), bgm, fgm, 5,
                    cv::GC_INIT_WITH_MASK);
        cv::Mat fg(w, w, CV_8U, cv::Scalar(0));
        fg(part).setTo(255, (label == cv::GC_FGD) | (label == cv::GC_PR_FGD));
        cv::morphologyEx(fg, fg, cv::MORPH_OPEN, brush_disc(3));
        region_clean(fg, sh);
        int area = cv::countNonZero(fg), ha = cv::countNonZero(sh(part));
        if (area < ha * 8 / 10 || area > part.area() * 97 / 100) {
            *fallback = 1;
            soft_disc(out, hd);
            return 0;
        }
        cv::Mat big;
        cv::GaussianBlur(fg, fg, cv::Size(), 1.0);
        cv::resize(fg, big, cv::Size(N, N), 0, 0, cv::INTER_CUBIC);
        border_refine(big > 127, pic).copyTo(out);
        out.setTo(0, in == 0);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}

/* The mean colour of rgb (float) near by, where `where` is not 0; weight says
 * how much of it there is. */
static cv::Mat mean_near(cv::Mat &weight, const cv::Mat &rgb,
                         const cv::Mat &where, double reach)
{
    cv::Mat some, sum, three;

    where.convertTo(weight, CV_32F, 1 / 255.0);
    cv::cvtColor(weight, three, cv::COLOR_GRAY2BGR);
    cv::GaussianBlur(rgb.mul(three), sum, cv::Size(), reach);
    cv::GaussianBlur(weight, weight, cv::Size(), reach);
    cv::cvtColor(cv::max(weight, 1e-6), three, cv::COLOR_GRAY2BGR);
    cv::divide(sum, three, some);
    return some;
}

/* How much of a pixel is foreground, by its colour: 0 as the background, 1 as
 * the foreground; 1 too where the two look alike, and where the pixel is no
 * mixture of them. */
static float pixel_share(const cv::Vec3f &pixel, const cv::Vec3f &back,
                         const cv::Vec3f &fore)
{
    const cv::Vec3f line = fore - back;
    const double length = cv::norm(line), alike = 30;

    if (length < alike)
        return 1;
    const double t = (pixel - back).dot(line) / (length * length);
    const double in = std::clamp(t, 0.0, 1.0);
    const double off = cv::norm(pixel - back - (float)in * line) / length;
    /* full trust within a fifth of the way, none beyond two fifths */
    return (float)(1 - (1 - in) * std::clamp(2 - 5 * off, 0.0, 1.0));
}

int matte_unmix(uint8_t *rgb, uint8_t *matte, const uint8_t *inside, size_t n,
                struct error *err)
{
    try {
        const int N = (int)n, rim = std::max(2, N / 64);
        cv::Mat pic(N, N, CV_8UC3, rgb), mat(N, N, CV_8U, matte);
        const cv::Mat in(N, N, CV_8U, const_cast<uint8_t *>(inside));
        cv::Mat colour, inner, outer, fw, bw;
        pic.convertTo(colour, CV_32F);
        /* where the picture ends is no border of the person's */
        cv::erode((mat > 127) | (in == 0), inner, brush_disc(2 * rim));
        cv::dilate(mat > 127, outer, brush_disc(2 * rim));
        const cv::Mat fore = mean_near(fw, colour, inner & in, rim);
        const cv::Mat back = mean_near(bw, colour, (outer == 0) & in, rim);
        for (int y = 0; y < N; y++)
            for (int x = 0; x < N; x++) {
                if (inner.at<uchar>(y, x) || !mat.at<uchar>(y, x)
                    || fw.at<float>(y, x) < 1e-3f
                    || bw.at<float>(y, x) < 1e-3f)
                    continue;
                const cv::Vec3f F = fore.at<cv::Vec3f>(y, x);
                const cv::Vec3f B = back.at<cv::Vec3f>(y, x);
                const cv::Vec3f I = colour.at<cv::Vec3f>(y, x);
                const float t = pixel_share(I, B, F);
                const cv::Vec3f C = I + (1 - t) * (F - B);
                uchar &m = mat.at<uchar>(y, x);
                m = cv::saturate_cast<uchar>((float)m * std::min(1.0f, 2 * t));
                for (int k = 0; m && k < 3; k++)
                    pic.at<cv::Vec3b>(y, x)[k] = cv::saturate_cast<uchar>(
                        C[k]);
            }
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}

/* The part of a source crop that lies in its picture: outside it is black to
 * the last level. */
static cv::Rect picture_part(const cv::Mat &rgb)
{
    cv::Mat grey, some;

    cv::reduce(rgb.reshape(1, rgb.rows * rgb.cols), grey, 1, cv::REDUCE_MAX);
    cv::findNonZero(grey.reshape(1, rgb.rows), some);
    cv::Rect all(0, 0, rgb.cols, rgb.rows);
    if (some.empty())
        return all;
    /* without the pixels that resizing mixed with black */
    cv::Rect r = cv::boundingRect(some);
    int l = r.x ? 3 : 0, t = r.y ? 3 : 0;
    r.width -= l + (r.x + r.width < all.width ? 3 : 0);
    r.height -= t + (r.y + r.height < all.height ? 3 : 0);
    r.x += l;
    r.y += t;
    return r.width > 8 && r.height > 8 ? r : all;
}

/* rgb without the masked part, at its own size; colours run on beyond the
 * part of the picture. */
static cv::Mat fill_small(const cv::Mat &rgb, const cv::Mat &hole,
                          cv::Rect part)
{
    const int w = rgb.cols;
    cv::Mat in = rgb(part), h = hole(part), filled, blur, all, soft;

    if (cv::countNonZero(h) == part.area())
        return cv::Mat(w, w, CV_8UC3, cv::mean(in));
    cv::inpaint(in, h, filled, w / 20.0, cv::INPAINT_TELEA);
    cv::GaussianBlur(filled, blur, cv::Size(), w / 40.0);
    blur.copyTo(filled, h);
    cv::copyMakeBorder(filled, all, part.y, w - part.y - part.height, part.x,
                       w - part.x - part.width, cv::BORDER_REPLICATE);
    cv::GaussianBlur(all, soft, cv::Size(), w / 16.0);
    filled.copyTo(soft(part));
    return soft;
}

int matte_fill(uint8_t *background, const uint8_t *rgb, const uint8_t *matte,
               size_t n, struct error *err)
{
    try {
        const int N = (int)n, w = std::max(16, N / 4);
        cv::Mat out(N, N, CV_8UC3, background);
        cv::Mat pic(N, N, CV_8UC3, const_cast<uint8_t *>(rgb));
        cv::Mat mat(N, N, CV_8U, const_cast<uint8_t *>(matte));
        cv::Mat small, hole, wide, big, soft;
        cv::resize(pic, small, cv::Size(w, w), 0, 0, cv::INTER_AREA);
        cv::Rect part = picture_part(pic), sp;
        sp.x = (part.x * w + N - 1) / N;       /* whole small pixels inside */
        sp.y = (part.y * w + N - 1) / N;
        sp.width = std::max(1, (part.x + part.width) * w / N - sp.x);
        sp.height = std::max(1, (part.y + part.height) * w / N - sp.y);
        sp &= cv::Rect(0, 0, w, w);
        cv::dilate(mat > 8, wide, brush_disc(N / 32));
        cv::resize(wide, hole, cv::Size(w, w), 0, 0, cv::INTER_AREA);
        cv::Mat filled = fill_small(small, hole > 0, sp);
        cv::resize(filled, big, cv::Size(N, N), 0, 0, cv::INTER_CUBIC);
        /* the real picture where it shows the background */
        cv::Mat outside(N, N, CV_8U, cv::Scalar(255));
        outside(part).setTo(0);
        cv::max(wide, outside, wide);
        cv::GaussianBlur(wide, soft, cv::Size(), N / 128.0);
        cv::max(soft, wide, soft);
        for (int y = 0; y < N; y++)
            for (int x = 0; x < N; x++) {
                int a = soft.at<uchar>(y, x);
                for (int k = 0; k < 3; k++)
                    out.at<cv::Vec3b>(y, x)[k] = (uchar)(
                        (big.at<cv::Vec3b>(y, x)[k] * a
                         + pic.at<cv::Vec3b>(y, x)[k] * (255 - a) + 127)
                        / 255);
            }
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "background: %s", e.what());
    }
}
