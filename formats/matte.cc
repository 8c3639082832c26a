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
    cv::erode(mask, inner, mask_disc(2 * r));
    cv::dilate(mask, outer, mask_disc(2 * r));
    q = (q - 0.1) / 0.8;
    q.convertTo(out, CV_8U, 255);
    out.setTo(255, inner);
    out.setTo(0, outer == 0);
    return out;
}

/* What is used when the colours decide nothing: the head, widened. */
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
    cv::Mat fg(p.small.size(), CV_8U, cv::Scalar(0)), background, foreground;

    cv::theRNG().state = 0x5eed;
    cv::setRNGSeed(1);
    cv::grabCut(p.small(part).clone(), label, cv::Rect(), background,
                foreground, 5, cv::GC_INIT_WITH_MASK);
    fg(part).setTo(255, (label == cv::GC_FGD) | (label == cv::GC_PR_FGD));
    cv::morphologyEx(fg, fg, cv::MORPH_OPEN, mask_disc(3));
    matte_region_clean(fg, p.small_head);
    return fg;
}

int matte_grabcut(uint8_t *matte, int *fallback, const uint8_t *rgb,
                  const uint8_t *head, const uint8_t *inside, size_t n,
                  struct error *err)
{
    *fallback = 0;
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
        if (!cv::countNonZero((label == cv::GC_BGD)
                              | (label == cv::GC_PR_BGD))) {
            *fallback = 1;             /* nothing but the face to be seen */
            matte_soft_disc(out, p.head);
            return 0;
        }
        cv::Mat fg = matte_foreground(label, p, part);
        int area = cv::countNonZero(fg), ha = cv::countNonZero(sh(part));
        if (area < ha * 8 / 10 || area > part.area() * 97 / 100) {
            *fallback = 1;
            matte_soft_disc(out, p.head);
            return 0;
        }
        cv::Mat big;
        cv::GaussianBlur(fg, fg, cv::Size(), 1.0);
        cv::resize(fg, big, cv::Size(N, N), 0, 0, cv::INTER_CUBIC);
        matte_border_refine(big > 127, p.rgb).copyTo(out);
        out.setTo(0, p.inside == 0);
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}

/* Where alpha is undecided over more than a rim, the colours of what is decided
 * settle it: GrabCut with that as seeds.  All pictures of one size, which show
 * the photograph alone. */
static void matte_cut_unsure(cv::Mat alpha, const cv::Mat &small,
                             const cv::Mat &core)
{
    const int w = alpha.cols;
    cv::Mat label(alpha.size(), CV_8U, cv::Scalar(cv::GC_PR_BGD)), bgm, fgm;
    cv::Mat unsure = (alpha > 0.12f) & (alpha < 0.97f), fg;

    cv::morphologyEx(unsure, unsure, cv::MORPH_OPEN, mask_disc(w / 50));
    if (cv::countNonZero(unsure) < w * w / 200)
        return;
    cv::dilate(unsure, unsure, mask_disc(w / 40));
    label.setTo(cv::GC_PR_FGD, alpha > 0.5f);
    label.setTo(cv::GC_BGD, alpha < 0.05f);
    label.setTo(cv::GC_FGD, (alpha > 0.95f) | core);
    cv::theRNG().state = 0x5eed;
    cv::setRNGSeed(1);
    cv::grabCut(small.clone(), label, cv::Rect(), bgm, fgm, 3,
                cv::GC_INIT_WITH_MASK);
    fg = (label == cv::GC_FGD) | (label == cv::GC_PR_FGD);
    fg.convertTo(fg, CV_32F, 1 / 255.0);
    cv::GaussianBlur(fg, fg, cv::Size(), 1.0);
    fg.copyTo(alpha, unsure);
}

/* What hangs together with the head: pieces of more than a quarter elsewhere
 * are other people or things. */
static void matte_region_keep(cv::Mat &alpha, const cv::Mat &head)
{
    cv::Mat label;
    const int n = cv::connectedComponents(alpha > 0.25f, label, 8);
    std::vector<uchar> keep = mask_touched(label, n, head);

    cv::Mat kept = mask_of_labels(label, keep), near;

    /* what is too faint to be a piece is of the nearest */
    cv::dilate(kept, near, mask_disc(alpha.cols / 40));
    alpha.setTo(0, (near == 0) | ((alpha > 0.25f) & (kept == 0)));
}

/* alpha at the picture's size: enlarged, and where neighbouring pixels say
 * that it goes with the brightness, with the brightness's fine part (the lines
 * of a guided filter, He et al. 2010). */
static cv::Mat matte_detail_add(const cv::Mat &alpha, const cv::Mat &rgb)
{
    const cv::Size k(5, 5);
    cv::Mat I, small, coarse, a, mI, mp, mIp, mII, big;

    cv::cvtColor(rgb, I, cv::COLOR_RGB2GRAY);
    I.convertTo(I, CV_32F, 1 / 255.0);
    cv::resize(I, small, alpha.size(), 0, 0, cv::INTER_AREA);
    cv::blur(small, mI, k);
    cv::blur(alpha, mp, k);
    cv::blur(small.mul(alpha), mIp, k);
    cv::blur(small.mul(small), mII, k);
    cv::divide(mIp - mI.mul(mp), mII - mI.mul(mI) + 2e-3, a);
    cv::resize(alpha, big, rgb.size(), 0, 0, cv::INTER_LINEAR);
    cv::resize(a, a, rgb.size(), 0, 0, cv::INTER_LINEAR);
    cv::resize(small, coarse, rgb.size(), 0, 0, cv::INTER_LINEAR);
    return big + a.mul(I - coarse);
}

int matte_refine(uint8_t *matte, int *absurd, const float *coarse, size_t w,
                 const uint8_t *rgb, const uint8_t *head,
                 const uint8_t *inside, size_t n, struct error *err)
{
    try {
        const int N = (int)n, W = (int)w;
        cv::Mat out(N, N, CV_8U, matte), core, fine;
        const matte_pictures p = matte_pictures_make(rgb, head, inside, N, W);
        cv::Mat alpha = cv::Mat(W, W, CV_32F,
                                const_cast<float *>(coarse)).clone();
        /* the face itself is the person's, whatever crosses it */
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
        *absurd = !ha || found < ha * 7 / 10 || area > W * W * 97 / 100;
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
