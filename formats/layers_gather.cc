/* What of a person's colours reaches past the matte (layers_parts.hh): told by
 * the colours' statistics about each place. */
#include "formats/layers_parts.hh"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

/* The settled colours about a place. */
struct layers_statistics {
    cv::Vec3d back;         /* the background's mean */
    cv::Matx33d covariance; /* and covariance */
    cv::Vec3d line;         /* from that mean to the person's colour */
};

/* What they are made of: sums over the background's pixels (how many, their
 * colours c, the lower half of c c'), then over those with a matte m (m, its
 * square, m c).  Whole numbers: in which order they are added is no matter. */
enum {
    SUM_N, SUM_BACK, SUM_TWO = SUM_BACK + 3, SUM_MATTE = SUM_TWO + 6,
    SUM_MATTE2, SUM_PERSON, SUM_COUNT = SUM_PERSON + 3
};
typedef cv::Vec<int, SUM_COUNT> layers_sums;

/* Adds a pixel of the background. */
static void layers_sums_add_back(layers_sums &s, const cv::Vec3b &c)
{
    s[SUM_N]++;
    for (int i = 0, k = SUM_TWO; i < 3; i++) {
        s[SUM_BACK + i] += c[i];
        for (int j = 0; j <= i; j++)
            s[k++] += c[i] * c[j];
    }
}

/* Adds one of matte m. */
static void layers_sums_add_person(layers_sums &s, const cv::Vec3b &c, int m)
{
    s[SUM_MATTE] += m;
    s[SUM_MATTE2] += m * m;
    for (int i = 0; i < 3; i++)
        s[SUM_PERSON + i] += m * c[i];
}

/* The sums of a cell's pixels, every `step` of them: the background's are
 * further than rim from the matte. */
static layers_sums layers_sums_of_cell(const cv::Mat &mat, const cv::Mat &far,
                                       const cv::Mat &rgb, const cv::Rect &cell,
                                       int rim)
{
    const int step = std::max(1, rim / 3);
    layers_sums s = layers_sums::all(0);

    for (int y = cell.y; y < cell.br().y; y += step)
        for (int x = cell.x; x < cell.br().x; x += step) {
            const int m = mat.at<uchar>(y, x);

            if (m)
                layers_sums_add_person(s, rgb.at<cv::Vec3b>(y, x), m);
            else if (far.at<float>(y, x) > (float)rim)
                layers_sums_add_back(s, rgb.at<cv::Vec3b>(y, x));
        }
    return s;
}

/* A picture in cells of side rim, so many across and down. */
struct layers_cells {
    int rim;
    cv::Size size;
    cv::Rect picture;
};

/* Cell (x,y)'s pixels. */
static cv::Rect layers_cell(const struct layers_cells &c, int x, int y)
{
    return cv::Rect(x * c.rim, y * c.rim, c.rim, c.rim) & c.picture;
}

/* The sums of cell (x,y) and of those within 4 cells of it; all: each one's. */
static layers_sums layers_sums_about(const std::vector<layers_sums> &all,
                                     const struct layers_cells &c, int x,
                                     int y)
{
    const cv::Rect near = cv::Rect(x - 4, y - 4, 9, 9) & cv::Rect({}, c.size);
    layers_sums sum = layers_sums::all(0);

    for (int j = near.y; j < near.br().y; j++)
        for (int i = near.x; i < near.br().x; i++)
            sum += all[(size_t)(j * c.size.width + i)];
    return sum;
}

/* The background's colours, and the person's, which fits matte x line = colour
 * - back best.  false where there is too little of either. */
static bool layers_measure(struct layers_statistics *at, const layers_sums &s)
{
    const double n = s[SUM_N], sum = s[SUM_MATTE] / 255.0;
    const double sum2 = s[SUM_MATTE2] / 65025.0;
    cv::Vec3d person;
    cv::Matx33d two;

    if (n < 16 || sum2 < 4)
        return false;
    for (int i = 0, k = SUM_TWO; i < 3; i++) {
        person[i] = s[SUM_PERSON + i] / 255.0;
        at->back[i] = s[SUM_BACK + i] / n;
        for (int j = 0; j <= i; j++)
            two(i, j) = two(j, i) = s[k++] / n;
    }
    at->covariance = two - at->back * at->back.t();
    at->line = (person - sum * at->back) / sum2;
    return true;
}

/* The share of the person in a colour there: 0 unless it lies further from the
 * background than that varies, and that on the way to a person who can be told
 * apart. */
static double layers_spill(const struct layers_statistics &at,
                           const cv::Vec3d &c)
{
    const cv::Vec3d off = c - at.back;
    const double length = cv::norm(at.line);

    if (length < 24)
        return 0;
    const cv::Vec3d way = at.line / length;
    const double along = off.dot(way);
    const double usual = std::sqrt(std::max(0.0, way.dot(at.covariance * way)));
    const double any = std::sqrt(std::max(0.0, cv::trace(at.covariance)));
    if (along < 2 * usual + 2
        || cv::norm(off - along * way) > 0.5 * along + any)
        return 0;
    return along / length;
}

/* A cell's pixels that lie just outside of the matte or where it is thin: those
 * whose colours are mixed with the person's gain the matte that explains
 * them. */
static void layers_gain(cv::Mat &mat, const cv::Mat &mixed, const cv::Mat &rgb,
                        const cv::Rect &cell,
                        const struct layers_statistics &at)
{
    for (int y = cell.y; y < cell.y + cell.height; y++)
        for (int x = cell.x; x < cell.x + cell.width; x++)
            if (mixed.at<uchar>(y, x)) {
                const cv::Vec3f c = rgb.at<cv::Vec3b>(y, x);
                uchar &m = mat.at<uchar>(y, x);
                m = std::max(m, cv::saturate_cast<uchar>(
                                    255 * layers_spill(at, c)));
            }
}

/* f(x, y) of all cells, by all threads. */
template <class F> static void layers_each_cell(const struct layers_cells &c,
                                                F f)
{
    cv::parallel_for_(cv::Range(0, c.size.height), [&](const cv::Range &rows) {
        for (int y = rows.start; y < rows.end; y++)
            for (int x = 0; x < c.size.width; x++)
                f(x, y);
    });
}

void layers_gather(cv::Mat &mat, const cv::Mat &rgb, const cv::Mat &in)
{
    const int rim = std::max(2, (3 * mat.rows + 256) / 512);
    const cv::Size size((mat.cols + rim - 1) / rim, (mat.rows + rim - 1) / rim);
    const struct layers_cells cells = {rim, size, cv::Rect({}, mat.size())};
    std::vector<layers_sums> all((size_t)size.area());
    cv::Mat far;

    cv::distanceTransform(mat == 0, far, cv::DIST_L2, 3);
    const cv::Mat mixed = (mat < 250) & (far <= rim) & in;
    far.setTo(0, in == 0);
    layers_each_cell(cells, [&](int x, int y) {
        all[(size_t)(y * size.width + x)] =
            layers_sums_of_cell(mat, far, rgb, layers_cell(cells, x, y), rim);
    });
    layers_each_cell(cells, [&](int x, int y) {
        const cv::Rect cell = layers_cell(cells, x, y);
        struct layers_statistics at;

        if (cv::countNonZero(mixed(cell)) &&
            layers_measure(&at, layers_sums_about(all, cells, x, y)))
            layers_gain(mat, mixed, rgb, cell, at);
    });
}
