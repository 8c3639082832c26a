/* The person cut out of the source picture: GrabCut seeded by the projected
 * head (Rother et al. 2004), its border refined; or a network's coarse matte
 * at the picture's own size. */
extern "C" {
#include "formats/matte.h"
}
#include "formats/mask.hh"

#include <sysexits.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

/* GrabCut works at this side: its cost grows faster than the pixels. */
static const int WORK = 256;
/* Percent of the picture: a person who covers more is absurd. */
static const int MOST = 97;

/* ---- what both ways share ---------------------------------------------- */

/* GrabCut of rgb from the seeds in label, the same every time: 255 where the
 * person is. */
static cv::Mat matte_grabcut_run(const cv::Mat &rgb, cv::Mat &label, int rounds)
{
    cv::Mat background, foreground;

    cv::theRNG().state = 0x5eed;
    cv::setRNGSeed(1);
    cv::grabCut(rgb.clone(), label, cv::Rect(), background, foreground, rounds,
                cv::GC_INIT_WITH_MASK);
    return (label == cv::GC_FGD) | (label == cv::GC_PR_FGD);
}

/* The picture's luminance, 0..1. */
static cv::Mat matte_luminance(const cv::Mat &rgb)
{
    cv::Mat out;

    cv::cvtColor(rgb, out, cv::COLOR_RGB2GRAY);
    out.convertTo(out, CV_32F, 1 / 255.0);
    return out;
}

/* The lines p = a I + b of a guided filter (He et al. 2010) in windows k of I
 * and p, ridge on a; mean_I and mean_p: their means there. */
static cv::Mat matte_guided_slope(cv::Mat &mean_I, cv::Mat &mean_p,
                                  const cv::Mat &I, const cv::Mat &p,
                                  const cv::Size &k, double ridge)
{
    cv::Mat mean_Ip, mean_II, a;

    cv::blur(I, mean_I, k);
    cv::blur(p, mean_p, k);
    cv::blur(I.mul(p), mean_Ip, k);
    cv::blur(I.mul(I), mean_II, k);
    cv::divide(mean_Ip - mean_I.mul(mean_p),
               mean_II - mean_I.mul(mean_I) + ridge, a);
    return a;
}

/* ---- by GrabCut ---------------------------------------------------------- */

/* Seeds from the head's silhouette: labels of cv::grabCut.  part: where the
 * square lies in its picture. */
static cv::Mat matte_grabcut_seeds(const cv::Mat &head, const cv::Rect &part)
{
    const int n = head.rows;
    cv::Rect box = cv::boundingRect(head);
    const int size = std::max(box.width, box.height);
    cv::Mat label(n, n, CV_8U, cv::Scalar(cv::GC_BGD)), core, hair;

    /* hair and headgear reach about a third of the head beyond it */
    cv::dilate(head, hair, mask_disc(size * 2 / 3));
    label.setTo(cv::GC_PR_BGD, hair);
    cv::dilate(head, hair, mask_disc(size / 5));
    label.setTo(cv::GC_PR_FGD, hair);
    cv::erode(head, core, mask_disc(std::max(3, size / 12)));
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
            /* everybody has shoulders, and their colours are needed */
            int below = y - (box.y + box.height * 9 / 10);
            if (below > 0 && d < std::min(tight + below, box.width * 9 / 10))
                l = cv::GC_FGD;
        }
    }
    /* borders above the shoulders are background if the head is away from
     * them */
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
static void matte_region_clean(cv::Mat &fg, const cv::Mat &head)
{
    cv::Mat label, stats, centres;

    fg = mask_piece_of_head(fg, head);
    const cv::Mat bg = fg == 0;
    const int n = cv::connectedComponentsWithStats(bg, label, stats, centres,
                                                   4);
    for (int i = 1; i < n; i++)
        if (stats.at<int>(i, cv::CC_STAT_AREA) < fg.rows * fg.cols / 50
            && stats.at<int>(i, cv::CC_STAT_TOP) > 0
            && stats.at<int>(i, cv::CC_STAT_LEFT) > 0)
            fg.setTo(255, label == i);
}

/* Soft border that follows the picture's edges: a guided filter of the mask,
 * with the picture's luminance as guide (He et al. 2010, local lines). */
static cv::Mat matte_border_refine(const cv::Mat &mask, const cv::Mat &rgb)
{
    const int r = std::max(3, mask.rows / 100);
    const cv::Size k(2 * r + 1, 2 * r + 1);
    const cv::Mat I = matte_luminance(rgb);
    cv::Mat p, mean_I, mean_p, a, b;

    mask.convertTo(p, CV_32F, 1 / 255.0);
    a = matte_guided_slope(mean_I, mean_p, I, p, k, 1e-4);
    b = mean_p - a.mul(mean_I);
    cv::blur(a, a, k);
    cv::blur(b, b, k);
    cv::Mat q = a.mul(I) + b, out;
    /* only the border may be soft */
    cv::Mat inner, outer;
    cv::erode(mask, inner, mask_disc(2 * r));
    cv::dilate(mask, outer, mask_disc(2 * r));
    q = (q - 0.1) / 0.8;
    q.convertTo(out, CV_8U, 255);
    out.setTo(255, inner);
    out.setTo(0, outer == 0);
    return out;
}

/* The matte when colours decide nothing: the head, widened. */
static void matte_soft_disc(cv::Mat &matte, const cv::Mat &head)
{
    cv::Mat m;

    cv::dilate(head, m, mask_disc(head.rows / 12));
    cv::GaussianBlur(m, matte, cv::Size(), head.rows / 80.0);
}

/* The pictures a matte is made of, [n,n] each, and small ones for deciding. */
struct matte_pictures {
    cv::Mat rgb, head, inside;      /* inside: 255 where there is a picture */
    cv::Mat small, small_head, small_inside;
};

/* From [n,n] pixels (inside: NULL is everywhere); small ones [w,w]. */
static matte_pictures matte_pictures_make(const uint8_t *rgb,
                                          const uint8_t *head,
                                          const uint8_t *inside, int n, int w)
{
    const cv::Size size(w, w);
    matte_pictures p;

    p.rgb = cv::Mat(n, n, CV_8UC3, const_cast<uint8_t *>(rgb));
    p.head = cv::Mat(n, n, CV_8U, const_cast<uint8_t *>(head));
    p.inside = cv::Mat(n, n, CV_8U, cv::Scalar(255));
    if (inside)
        std::memcpy(p.inside.data, inside, (size_t)n * (size_t)n);
    cv::resize(p.rgb, p.small, size, 0, 0, cv::INTER_AREA);
    cv::resize(p.head, p.small_head, size, 0, 0, cv::INTER_AREA);
    cv::resize(p.inside, p.small_inside, size, 0, 0, cv::INTER_NEAREST);
    p.small_head = p.small_head > 127;
    return p;
}

/* GrabCut from seeds in label, which belongs to part of the small picture:
 * 255 where the person is, one piece without holes. */
static cv::Mat matte_foreground(cv::Mat label, const matte_pictures &p,
                                const cv::Rect &part)
{
    cv::Mat fg(p.small.size(), CV_8U, cv::Scalar(0));

    fg(part).setTo(255, matte_grabcut_run(p.small(part), label, 5));
    cv::morphologyEx(fg, fg, cv::MORPH_OPEN, mask_disc(3));
    matte_region_clean(fg, p.small_head);
    return fg;
}

/* Whether a foreground is less than most of the head, or almost all of the
 * `pixels` that there are. */
static bool matte_is_absurd(const cv::Mat &fg, const cv::Mat &head, int pixels)
{
    const int area = cv::countNonZero(fg);

    return area < cv::countNonZero(head) * 8 / 10 || area > pixels * MOST / 100;
}

int matte_grabcut(uint8_t *matte, bool *fallback, const uint8_t *rgb,
                  const uint8_t *head, const uint8_t *inside, size_t n,
                  struct error *err)
{
    *fallback = false;
    try {
        const int N = (int)n, w = std::min(N, WORK);
        cv::Mat out(N, N, CV_8U, matte);
        const matte_pictures p = matte_pictures_make(rgb, head, inside, N, w);
        const cv::Mat &sh = p.small_head;
        /* what lies beyond the picture's border is black, and no background
         * to learn from */
        const cv::Rect part = cv::boundingRect(p.small_inside);
        if (!(part & cv::boundingRect(sh)).area())
            return error_set(err, EX_DATAERR, "the head lies outside the "
                             "picture (give --crop X,Y,SIZE or --mask FILE)");
        cv::Mat label = matte_grabcut_seeds(sh, part)(part).clone();
        const bool background = cv::countNonZero((label == cv::GC_BGD) |
                                                 (label == cv::GC_PR_BGD)) > 0;
        cv::Mat fg, big;

        if (background)
            fg = matte_foreground(label, p, part);
        *fallback = !background || matte_is_absurd(fg, sh(part), part.area());
        if (*fallback) {
            matte_soft_disc(out, p.head);
            return 0;
        }
        cv::GaussianBlur(fg, fg, cv::Size(), 1.0);
        cv::resize(fg, big, cv::Size(N, N), 0, 0, cv::INTER_CUBIC);
        matte_border_refine(big > 127, p.rgb).copyTo(out);
        out.setTo(0, p.inside == 0);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}

/* ---- from a network's matte ---------------------------------------------- */

/* Where alpha is undecided over more than a rim, colours decide: GrabCut with
 * what is decided as seeds.  All pictures have one size and show nothing beyond
 * the photograph. */
static void matte_cut_unsure(cv::Mat alpha, const cv::Mat &small,
                             const cv::Mat &core)
{
    const int w = alpha.cols;
    cv::Mat label(alpha.size(), CV_8U, cv::Scalar(cv::GC_PR_BGD));
    cv::Mat unsure = (alpha > 0.12f) & (alpha < 0.97f), fg;

    cv::morphologyEx(unsure, unsure, cv::MORPH_OPEN, mask_disc(w / 50));
    if (cv::countNonZero(unsure) < w * w / 200)
        return;
    cv::dilate(unsure, unsure, mask_disc(w / 40));
    label.setTo(cv::GC_PR_FGD, alpha > 0.5f);
    label.setTo(cv::GC_BGD, alpha < 0.05f);
    label.setTo(cv::GC_FGD, (alpha > 0.95f) | core);
    fg = matte_grabcut_run(small, label, 3);
    fg.convertTo(fg, CV_32F, 1 / 255.0);
    cv::GaussianBlur(fg, fg, cv::Size(), 1.0);
    fg.copyTo(alpha, unsure);
}

/* Keep what is connected with the head: other pieces, of alpha over 1/4, are
 * other people or things. */
static void matte_region_keep(cv::Mat &alpha, const cv::Mat &head)
{
    cv::Mat label;
    const int n = cv::connectedComponents(alpha > 0.25f, label, 8);
    std::vector<uchar> keep = mask_touched(label, n, head);

    cv::Mat kept = mask_of_labels(label, keep), near;

    /* fainter pixels belong to the nearest piece */
    cv::dilate(kept, near, mask_disc(alpha.cols / 40));
    alpha.setTo(0, (near == 0) | ((alpha > 0.25f) & (kept == 0)));
}

/* alpha at the picture's size: enlarged, with the fine detail of the luminance
 * where alpha follows that among neighbouring pixels. */
static cv::Mat matte_detail_add(const cv::Mat &alpha, const cv::Mat &rgb)
{
    const cv::Size k(5, 5);
    const cv::Mat I = matte_luminance(rgb);
    cv::Mat small, coarse, a, mean_I, mean_p, big;

    cv::resize(I, small, alpha.size(), 0, 0, cv::INTER_AREA);
    a = matte_guided_slope(mean_I, mean_p, small, alpha, k, 2e-3);
    cv::resize(alpha, big, rgb.size(), 0, 0, cv::INTER_LINEAR);
    cv::resize(a, a, rgb.size(), 0, 0, cv::INTER_LINEAR);
    cv::resize(small, coarse, rgb.size(), 0, 0, cv::INTER_LINEAR);
    return big + a.mul(I - coarse);
}

int matte_refine(uint8_t *matte, bool *absurd, const float *coarse, size_t w,
                 const uint8_t *rgb, const uint8_t *head,
                 const uint8_t *inside, size_t n, struct error *err)
{
    try {
        const int N = (int)n, W = (int)w;
        cv::Mat out(N, N, CV_8U, matte), core, fine;
        const matte_pictures p = matte_pictures_make(rgb, head, inside, N, W);
        cv::Mat alpha = cv::Mat(W, W, CV_32F,
                                const_cast<float *>(coarse)).clone();
        /* the middle of the face is the person, whatever crosses it */
        const cv::Rect box = cv::boundingRect(p.small_head);
        const int across = std::max(3, std::max(box.width, box.height) / 8);
        cv::erode(p.small_head, core, mask_disc(across));
        const cv::Rect part = cv::boundingRect(p.small_inside);
        if (part.area())
            matte_cut_unsure(alpha(part), p.small(part), core(part));
        matte_region_keep(alpha, p.small_head);
        const int ha = cv::countNonZero(core);
        const int found = cv::countNonZero(core & (alpha > 0.5f));
        const int area = cv::countNonZero(alpha > 0.5f);
        *absurd = !ha || found < ha * 7 / 10 || area > W * W * MOST / 100;
        if (*absurd)
            return 0;
        alpha.setTo(1, core);
        fine = (matte_detail_add(alpha, p.rgb) - 0.06) / 0.88;
        fine.convertTo(out, CV_8U, 255);
        out.setTo(0, p.inside == 0);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}
