/* Antialiased marks and words by OpenCV. */
extern "C" {
#include "formats/draw.h"
}

#include <cmath>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

static const int SHIFT = 4;    /* sub-pixel bits of OpenCV's drawing */

/* OpenCV's coordinates with SHIFT fractional bits, of pixel centres. */
static cv::Point draw_fixed_point(double x, double y)
{
    const double s = 1 << SHIFT;

    return cv::Point((int)std::lrint((x - 0.5) * s),
                     (int)std::lrint((y - 0.5) * s));
}

/* Draw with `what` and blend by the pen's alpha inside its canvas. */
template <class F>
static void draw_blended(struct canvas *c, const struct pen &pen, F what)
{
    cv::Mat m((int)c->height, (int)c->width, CV_8UC3, c->rgb);
    const cv::Scalar color(pen.color[0], pen.color[1], pen.color[2]);

    try {
        if (pen.alpha >= 1) {
            what(m, color);
        } else {
            cv::Mat t = m.clone();
            what(t, color);
            cv::addWeighted(t, pen.alpha, m, 1 - pen.alpha, 0, m);
        }
    } catch (const std::exception &) {
        /* nothing drawn: an overlay is never worth a run */
    }
}

/* Whole pixels, as OpenCV wants it. */
static int draw_thickness(const struct pen &pen)
{
    return std::max(1, (int)std::lrint(pen.width));
}

/* Finite, and not so far away that OpenCV's integers overflow. */
static bool draw_point_usable(const float *p)
{
    return std::fabs(p[0]) < 1e5f && std::fabs(p[1]) < 1e5f;
}

void draw_segments(struct canvas *c, const float *xy, size_t n,
                   struct pen pen)
{
    draw_blended(c, pen, [&](cv::Mat &m, const cv::Scalar &color) {
        for (size_t i = 0; i < n; i++, xy += 4)
            if (draw_point_usable(xy) && draw_point_usable(xy + 2))
                cv::line(m, draw_fixed_point(xy[0], xy[1]),
                         draw_fixed_point(xy[2], xy[3]), color,
                         draw_thickness(pen), cv::LINE_AA, SHIFT);
    });
}

void draw_square(struct canvas *c, struct square q, struct pen pen)
{
    const float l = (float)(q.x - q.size / 2), r = (float)(q.x + q.size / 2);
    const float t = (float)(q.y - q.size / 2), b = (float)(q.y + q.size / 2);
    const float s[16] = {l, t, r, t, r, t, r, b, r, b, l, b, l, b, l, t};

    draw_segments(c, s, 4, pen);
}

void draw_dots(struct canvas *c, const float *xy, size_t n, double radius,
               struct pen pen)
{
    draw_blended(c, pen, [&](cv::Mat &m, const cv::Scalar &color) {
        for (size_t i = 0; i < n; i++, xy += 2)
            if (draw_point_usable(xy))
                cv::circle(m, draw_fixed_point(xy[0], xy[1]),
                           (int)std::lrint(radius * (1 << SHIFT)), color, -1,
                           cv::LINE_AA, SHIFT);
    });
}

void draw_text(struct canvas *c, const char *text, double x, double y,
               double height, struct pen pen)
{
    const int font = cv::FONT_HERSHEY_SIMPLEX;
    const double scale = height / 21.0;    /* capitals are 21 units high */
    const int w = std::max(1, (int)std::lrint(height / 11));

    draw_blended(c, pen, [&](cv::Mat &m, const cv::Scalar &color) {
        cv::Point at((int)x, (int)y);
        cv::putText(m, text, at, font, scale, cv::Scalar(0, 0, 0), w + 2,
                         cv::LINE_AA);
        cv::putText(m, text, at, font, scale, color, w, cv::LINE_AA);
    });
}
