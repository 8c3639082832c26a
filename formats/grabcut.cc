/* GrabCut (grabcut.hh): colours of person and background as mixtures of five
 * Gaussians each, and a cut of least weight through the undecided pixels.
 * Decided pixels hang on their terminal by more than all their neighbours
 * together, so they are part of it: the graph holds the others alone. */
#include "formats/grabcut.hh"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>

static const int PARTS = 5;             /* Gaussians of a mixture */
static const double GAMMA = 50;         /* weight of neighbours, as published */
static const double LEAST_VOLUME = 1e-6, WIDER = 0.01;

/* One Gaussian: of colours x, share exp(-d/2) / sqrt(volume) with d the square
 * of the distance from the mean in its own measure. */
struct colour_part {
    double share, volume, bias, mean[3], inverse[6];
    double count, sum[3], product[6];
};

/* xx, xy, xz, yy, yz, zz */
static void grabcut_square(double out[6], const double x[3])
{
    for (int i = 0, at = 0; i < 3; i++)
        for (int j = i; j < 3; j++)
            out[at++] = x[i] * x[j];
}

static void grabcut_part_add(colour_part &p, const cv::Vec3b &pixel)
{
    const double x[3] = {(double)pixel[0], (double)pixel[1],
                         (double)pixel[2]};
    double square[6];

    grabcut_square(square, x);
    p.count++;
    for (int i = 0; i < 3; i++)
        p.sum[i] += x[i];
    for (int i = 0; i < 6; i++)
        p.product[i] += square[i];
}

static double grabcut_volume(const double c[6])
{
    return c[0] * (c[3] * c[5] - c[4] * c[4]) -
           c[1] * (c[1] * c[5] - c[4] * c[2]) +
           c[2] * (c[1] * c[4] - c[3] * c[2]);
}

/* From the sums of its pixels, of `all` in the mixture. */
static void grabcut_part_learn(colour_part &p, double all)
{
    double c[6];

    p.share = p.count / all;
    if (p.count == 0)
        return;
    for (int i = 0; i < 3; i++)
        p.mean[i] = p.sum[i] / p.count;
    grabcut_square(c, p.mean);
    for (int i = 0; i < 6; i++)
        c[i] = p.product[i] / p.count - c[i];
    p.volume = grabcut_volume(c);
    if (p.volume <= LEAST_VOLUME) {     /* one colour, or a line of them */
        c[0] += WIDER;
        c[3] += WIDER;
        c[5] += WIDER;
        p.volume = grabcut_volume(c);
    }
    p.bias = std::log(p.volume);
    p.inverse[0] = (c[3] * c[5] - c[4] * c[4]) / p.volume;
    p.inverse[1] = (c[2] * c[4] - c[1] * c[5]) / p.volume;
    p.inverse[2] = (c[1] * c[4] - c[2] * c[3]) / p.volume;
    p.inverse[3] = (c[0] * c[5] - c[2] * c[2]) / p.volume;
    p.inverse[4] = (c[1] * c[2] - c[0] * c[4]) / p.volume;
    p.inverse[5] = (c[0] * c[3] - c[1] * c[1]) / p.volume;
}

static double grabcut_distance(const colour_part &p, const cv::Vec3b &pixel)
{
    const double x = pixel[0] - p.mean[0], y = pixel[1] - p.mean[1];
    const double z = pixel[2] - p.mean[2], *m = p.inverse;

    return x * (m[0] * x + 2 * (m[1] * y + m[2] * z)) +
           y * (m[3] * y + 2 * m[4] * z) + z * m[5] * z;
}

/* ---- mixtures ---------------------------------------------------------- */

struct colours {
    colour_part part[PARTS];
};

static void grabcut_mix_clear(colours &g)
{
    for (colour_part &p : g.part) {
        p.count = 0;
        for (double &x : p.sum)
            x = 0;
        for (double &x : p.product)
            x = 0;
    }
}

static void grabcut_mix_learn(colours &g)
{
    double all = 0;

    for (const colour_part &p : g.part)
        all += p.count;
    for (colour_part &p : g.part)
        grabcut_part_learn(p, all);
}

/* The part that a pixel most likely comes from. */
static int grabcut_mix_nearest(const colours &g, const cv::Vec3b &pixel)
{
    double least = DBL_MAX;
    int best = 0;

    for (int k = 0; k < PARTS; k++) {
        const colour_part &p = g.part[k];
        const double d = p.share > 0 ? grabcut_distance(p, pixel) + p.bias
                                     : DBL_MAX;
        if (d < least) {
            least = d;
            best = k;
        }
    }
    return best;
}

/* -log of a pixel's density. */
static double grabcut_mix_cost(const colours &g, const cv::Vec3b &pixel)
{
    double sum = 0;

    for (const colour_part &p : g.part)
        if (p.share > 0)
            sum += p.share / std::sqrt(p.volume) *
                   std::exp(-0.5 * grabcut_distance(p, pixel));
    return -std::log(std::max(sum, DBL_MIN));
}

/* ---- rounds ------------------------------------------------------------ */

/* Whether a label says person. */
static bool grabcut_is_person(uchar label)
{
    return label == cv::GC_FGD || label == cv::GC_PR_FGD;
}

static bool grabcut_is_open(uchar label)
{
    return label == cv::GC_PR_BGD || label == cv::GC_PR_FGD;
}

/* First mixtures of background [0] and person [1], by k-means. */
static void grabcut_begin(colours mixture[2], const cv::Mat &label,
                          const cv::Mat &rgb)
{
    const cv::TermCriteria rounds(cv::TermCriteria::COUNT, 10, 0);

    for (int side = 0; side < 2; side++) {
        std::vector<cv::Vec3f> sample;
        cv::Mat part;
        for (int y = 0; y < rgb.rows; y++)
            for (int x = 0; x < rgb.cols; x++)
                if (grabcut_is_person(label.at<uchar>(y, x)) == (side == 1))
                    sample.push_back(cv::Vec3f(rgb.at<cv::Vec3b>(y, x)));
        cv::kmeans(cv::Mat((int)sample.size(), 3, CV_32F, sample.data()),
                   std::min(PARTS, (int)sample.size()), part, rounds, 0,
                   cv::KMEANS_PP_CENTERS);
        grabcut_mix_clear(mixture[side]);
        for (int i = 0; i < part.rows; i++)
            grabcut_part_add(mixture[side].part[part.at<int>(i)],
                             cv::Vec3b(sample[(size_t)i]));
        grabcut_mix_learn(mixture[side]);
    }
}

/* The mixtures of what the labels say now. */
static void grabcut_learn(colours mixture[2], const cv::Mat &label,
                          const cv::Mat &rgb)
{
    const colours before[2] = {mixture[0], mixture[1]};

    grabcut_mix_clear(mixture[0]);
    grabcut_mix_clear(mixture[1]);
    for (int y = 0; y < rgb.rows; y++)
        for (int x = 0; x < rgb.cols; x++) {
            const cv::Vec3b &pixel = rgb.at<cv::Vec3b>(y, x);
            const int side = grabcut_is_person(label.at<uchar>(y, x));
            const int k = grabcut_mix_nearest(before[side], pixel);
            grabcut_part_add(mixture[side].part[k], pixel);
        }
    grabcut_mix_learn(mixture[0]);
    grabcut_mix_learn(mixture[1]);
}

/* Neighbours that come before a pixel: left, and three above. */
static const int SIDE[4][2] = {{-1, 0}, {-1, -1}, {0, -1}, {1, -1}};

static int grabcut_difference(const cv::Vec3b &a, const cv::Vec3b &b)
{
    int sum = 0;

    for (int c = 0; c < 3; c++)
        sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sum;
}

/* One over twice the mean square between neighbours. */
static double grabcut_contrast(const cv::Mat &rgb)
{
    double sum = 0, pairs = 0;

    for (int y = 0; y < rgb.rows; y++)
        for (int x = 0; x < rgb.cols; x++)
            for (const int *d : SIDE) {
                if (x + d[0] < 0 || x + d[0] >= rgb.cols || y + d[1] < 0)
                    continue;
                sum += grabcut_difference(rgb.at<cv::Vec3b>(y, x),
                                         rgb.at<cv::Vec3b>(y + d[1],
                                                           x + d[0]));
                pairs++;
            }
    return sum > 0 ? pairs / (2 * sum) : 0;
}

typedef cv::detail::GCGraph<double> graph;

/* An edge between neighbours; with a decided one, to its terminal. */
static void grabcut_join(graph &g, const cv::Mat &node, const cv::Mat &label,
                         cv::Point p, cv::Point q, double weight)
{
    const int a = node.at<int>(p), b = node.at<int>(q);

    if (a >= 0 && b >= 0) {
        g.addEdges(a, b, weight, weight);
    } else if (a >= 0 || b >= 0) {
        const bool person = grabcut_is_person(label.at<uchar>(a >= 0 ? q : p));
        g.addTermWeights(a >= 0 ? a : b, person ? weight : 0,
                         person ? 0 : weight);
    }
}

/* Number the undecided pixels in node (-1: decided); how many. */
static int grabcut_number(cv::Mat &node, const cv::Mat &label)
{
    int count = 0;

    node.create(label.size(), CV_32S);
    for (int y = 0; y < label.rows; y++)
        for (int x = 0; x < label.cols; x++)
            node.at<int>(y, x) =
                grabcut_is_open(label.at<uchar>(y, x)) ? count++ : -1;
    return count;
}

/* The least cut under these mixtures, into the labels. */
static void grabcut_cut(cv::Mat &label, const cv::Mat &rgb,
                        const colours mixture[2], double contrast)
{
    cv::Mat node;
    const int count = grabcut_number(node, label);
    graph g((unsigned)count, 8 * (unsigned)count);

    for (int y = 0; y < rgb.rows; y++)
        for (int x = 0; x < rgb.cols; x++) {
            const cv::Vec3b &pixel = rgb.at<cv::Vec3b>(y, x);
            if (node.at<int>(y, x) >= 0)
                g.addTermWeights(g.addVtx(),
                                 grabcut_mix_cost(mixture[0], pixel),
                                 grabcut_mix_cost(mixture[1], pixel));
            for (const int *d : SIDE) {
                const cv::Point q(x + d[0], y + d[1]);
                if (q.x < 0 || q.x >= rgb.cols || q.y < 0
                    || (node.at<int>(y, x) < 0 && node.at<int>(q) < 0))
                    continue;
                const int off = grabcut_difference(pixel,
                                                  rgb.at<cv::Vec3b>(q));
                const double reach = d[0] && d[1] ? std::sqrt(2.0) : 1;
                grabcut_join(g, node, label, cv::Point(x, y), q,
                             GAMMA / reach * std::exp(-contrast * off));
            }
        }
    g.maxFlow();
    for (int y = 0; y < label.rows; y++)
        for (int x = 0; x < label.cols; x++)
            if (node.at<int>(y, x) >= 0)
                label.at<uchar>(y, x) =
                    g.inSourceSegment(node.at<int>(y, x)) ? cv::GC_PR_FGD
                                                          : cv::GC_PR_BGD;
}

void grabcut_run(cv::Mat &label, const cv::Mat &rgb, int rounds)
{
    const double contrast = grabcut_contrast(rgb);
    colours mixture[2];

    grabcut_begin(mixture, label, rgb);
    for (int i = 0; i < rounds; i++) {
        grabcut_learn(mixture, label, rgb);
        grabcut_cut(label, rgb, mixture, contrast);
    }
}
