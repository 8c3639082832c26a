/* The person before a plain wall, cut out by the wall's colour: what a studio
 * does with a coloured screen (Smith and Blinn 1996), with a wall that is not
 * evenly lit. */
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

static const int TERMS = 6;             /* of a quadratic in x and y */
static const double PLAIN = 0.85;       /* share of the surroundings */
static const double ROUGH = 8;          /* levels that a wall may vary by */

/* The monomials at pixel (x,y) of n. */
static void wall_terms(double t[TERMS], int x, int y, int n)
{
    const double u = (double)x / n - 0.5, v = (double)y / n - 0.5;
    const double all[TERMS] = {1, u, v, u * u, u * v, v * v};

    std::copy(all, all + TERMS, t);
}

/* wall (n,n) floats: the quadratics that fit pic best where seed is set. */
static bool wall_fit(cv::Mat &wall, const cv::Mat &pic, const cv::Mat &seed)
{
    const int n = pic.rows;
    cv::Mat a = cv::Mat::zeros(TERMS, TERMS, CV_64F), c;
    cv::Mat b = cv::Mat::zeros(TERMS, 3, CV_64F);
    double t[TERMS];

    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            if (!seed.at<uchar>(y, x))
                continue;
            const cv::Vec3b p = pic.at<cv::Vec3b>(y, x);
            wall_terms(t, x, y, n);
            for (int i = 0; i < TERMS; i++) {
                for (int j = 0; j < TERMS; j++)
                    a.at<double>(i, j) += t[i] * t[j];
                for (int k = 0; k < 3; k++)
                    b.at<double>(i, k) += t[i] * p[k];
            }
        }
    if (!cv::solve(a, b, c, cv::DECOMP_CHOLESKY))
        return false;
    wall.create(n, n, CV_32FC3);
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            cv::Vec3f &w = wall.at<cv::Vec3f>(y, x);
            w = cv::Vec3f(0, 0, 0);
            wall_terms(t, x, y, n);
            for (int i = 0; i < TERMS; i++)
                for (int k = 0; k < 3; k++)
                    w[k] += (float)(t[i] * c.at<double>(i, k));
        }
    return true;
}

/* How far pic is from the wall: in brightness, and twice in colour. */
static cv::Mat wall_distance(const cv::Mat &pic, const cv::Mat &wall)
{
    cv::Mat out(pic.size(), CV_32F);

    for (int y = 0; y < pic.rows; y++)
        for (int x = 0; x < pic.cols; x++) {
            cv::Vec3f d = cv::Vec3f(pic.at<cv::Vec3b>(y, x)) -
                          wall.at<cv::Vec3f>(y, x);
            float l = (d[0] + d[1] + d[2]) / 3, s = l * l;
            for (int k = 0; k < 3; k++)
                s += 2 * (d[k] - l) * (d[k] - l);
            out.at<float>(y, x) = std::sqrt(s);
        }
    return out;
}

/* The median of d where seed is set. */
static float wall_median(const cv::Mat &d, const cv::Mat &seed)
{
    std::vector<float> v;

    for (int y = 0; y < d.rows; y++)
        for (int x = 0; x < d.cols; x++)
            if (seed.at<uchar>(y, x))
                v.push_back(d.at<float>(y, x));
    std::nth_element(v.begin(), v.begin() + (long)v.size() / 2, v.end());
    return v[v.size() / 2];
}

/* The wall beside and above the head, fitted repeatedly without the pixels that
 * do not belong to it.  spread: levels that it varies by; d: every pixel's
 * distance from it; false: it is not plain. */
static bool wall_find(cv::Mat &wall, cv::Mat &d, float *spread,
                      const cv::Mat &pic, const cv::Mat &head,
                      const cv::Mat &in)
{
    const cv::Rect box = cv::boundingRect(head);
    const int size = std::max(box.width, box.height);
    cv::Mat around, seed, use;

    cv::dilate(head, around, mask_disc(size / 3));
    seed = in & ~around;
    seed.rowRange(std::min(box.br().y, seed.rows), seed.rows).setTo(0);
    const int count = cv::countNonZero(seed);
    if (count < pic.rows * pic.cols / 12)
        return false;
    seed.copyTo(use);
    for (int i = 0; i < 6; i++) {
        if (!wall_fit(wall, pic, use))
            return false;
        d = wall_distance(pic, wall);
        *spread = 1.5f * wall_median(d, use) + 1;
        use = seed & (d < 3 * *spread);
        if (cv::countNonZero(use) < count / 2)
            return false;
    }
    return *spread <= ROUGH && cv::countNonZero(use) > PLAIN * count;
}

/* Pieces of less than `least` pixels taken out of a mask. */
static void wall_drop_small(cv::Mat &mask, int least)
{
    cv::Mat label, stats, centres;
    const int n = cv::connectedComponentsWithStats(mask, label, stats,
                                                   centres, 8);

    for (int i = 1; i < n; i++)
        if (stats.at<int>(i, cv::CC_STAT_AREA) < least)
            mask.setTo(0, label == i);
}

/* The pieces of `like` that touch the picture's border above the shoulders. */
static cv::Mat wall_reach(const cv::Mat &like, int shoulders)
{
    cv::Mat label;
    const int n = cv::connectedComponents(like, label, 8), last = like.cols - 1;
    std::vector<uchar> keep((size_t)n, 0);

    for (int x = 0; x <= last; x++)
        keep[(size_t)label.at<int>(0, x)] = 255;
    for (int y = 0; y < shoulders; y++)
        keep[(size_t)label.at<int>(y, 0)] =
            keep[(size_t)label.at<int>(y, last)] = 255;
    keep[0] = 0;
    return mask_of_labels(label, keep);
}

/* 255 where the person is, rim included: other than the wall's colour, or where
 * no wall can show through, in the head and below it. */
static cv::Mat wall_person(const cv::Mat &d, const cv::Mat &head,
                           const cv::Mat &in, float near)
{
    const cv::Rect box = cv::boundingRect(head);
    const int n = d.rows, below = std::min(n, box.y + box.height * 19 / 20);
    cv::Mat like = (d < near) & in, solid, person;

    cv::dilate(head, solid, mask_disc(n / 40));
    solid.rowRange(below, n).setTo(255);
    wall_drop_small(like, n * n / 4000);
    person = in & ~(wall_reach(like, below) |
                    (like & ~solid));
    cv::morphologyEx(person, person, cv::MORPH_OPEN, mask_disc(3));
    person = mask_piece_of_head(person, head);
    cv::morphologyEx(person, person, cv::MORPH_CLOSE, mask_disc(n / 64));
    return person;
}

/* Whether the person in the picture's lowest row is complete: shoulders only
 * widen downwards, but white clothes before a white wall are not found. */
static bool wall_shoulders(const cv::Mat &person, const cv::Mat &in)
{
    const cv::Rect part = cv::boundingRect(in), box = cv::boundingRect(person);
    const int last = part.br().y - 1, count =
        cv::countNonZero(person.row(last));

    return box.br().y - 1 < last || count > 0.9 * box.width;
}

/* The matte of the person's rim from how far the colours are between the
 * wall's and the person's nearby. */
static cv::Mat wall_matte(const cv::Mat &d, const cv::Mat &person,
                          const cv::Mat &head, float floor)
{
    const int n = d.rows, rim = std::max(3, n / 76);
    cv::Mat far, a, inner, core, outer, own = cv::Mat::zeros(n, n, CV_32F);

    d.copyTo(own, person);
    cv::dilate(own, far, mask_disc(n / 42));
    cv::GaussianBlur(far, far, cv::Size(), n / 192.0);
    far = cv::max(0.8 * far - floor, 6.0);
    cv::divide(d - floor, far, a);
    a = cv::min(cv::max(a, 0.0), 1.0);
    cv::erode(person, inner, mask_disc(2 * rim));
    cv::erode(head, core, mask_disc(2 * rim));
    cv::dilate(person, outer, mask_disc(2 * rim));
    a.setTo(1, inner | (core & person));
    a.setTo(0, ~outer);
    return a;
}

int matte_wall(uint8_t *matte, bool *plain, const uint8_t *rgb,
               const uint8_t *head, const uint8_t *inside, size_t n,
               struct error *err)
{
    *plain = false;
    try {
        const int N = (int)n;
        cv::Mat pic(N, N, CV_8UC3, const_cast<uint8_t *>(rgb));
        cv::Mat hd(N, N, CV_8U, const_cast<uint8_t *>(head));
        cv::Mat in(N, N, CV_8U, const_cast<uint8_t *>(inside));
        cv::Mat out(N, N, CV_8U, matte), wall, d, person;
        float spread;

        if (!cv::countNonZero(hd & in) ||
            !wall_find(wall, d, &spread, pic, hd, in))
            return 0;
        const float floor = 2.2f * spread + 1.5f;
        person = wall_person(d, hd, in, 1.6f * floor);
        if (cv::countNonZero(person & hd) < cv::countNonZero(hd & in) * 8 / 10
            || !wall_shoulders(person, in))
            return 0;
        wall_matte(d, person, hd, floor).convertTo(out, CV_8U, 255);
        out.setTo(0, in == 0);
        *plain = true;
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_SOFTWARE, "matte: %s", e.what());
    }
}
