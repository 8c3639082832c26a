/* GrabCut with the cut of lib/geom/grid_cut.h.  Sums and formulae are in
 * cv::grabCut's order, so that labels are the same. */
#include "formats/grabcut.hh"
extern "C" {
#include "lib/geom/grid_cut.h"
}

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <vector>

#include <opencv2/imgproc.hpp>

static const int PARTS = 5;             /* Gaussians of a mixture */
static const double TIE = 50;           /* of neighbours of one colour */
static const double DECIDED = 1000;     /* more than all ties of a pixel */
static const double UNIT = 1 << 20;     /* of a capacity's whole numbers */

/* ---- colours of either side ---------------------------------------------- */

/* Sums over the colours of a part; whole numbers, in any order. */
struct mixture_sums {
    int64_t n, sum[3], two[3][3];
};

/* A mixture of Gaussians in the space of colours. */
struct mixture {
    double share[PARTS], mean[PARTS][3], inverse[PARTS][3][3], det[PARTS];
};

/* Both sides': the background's (labels 0 and 2), the person's (1 and 3). */
struct grabcut {
    cv::Mat rgb, label;
    cv::Mat part;                       /* of its side's mixture, a pixel's */
    cv::Mat tie;                        /* capacities, grabcut_before's */
    struct mixture side[2];
};

static void mixture_sums_add(struct mixture_sums *s, const cv::Vec3b &c)
{
    s->n++;
    for (int i = 0; i < 3; i++) {
        s->sum[i] += c[i];
        for (int j = 0; j < 3; j++)
            s->two[i][j] += c[i] * c[j];
    }
}

/* Determinant of a symmetric matrix, row by row. */
static double mixture_det(const double c[9])
{
    return c[0] * (c[4] * c[8] - c[5] * c[7])
           - c[1] * (c[3] * c[8] - c[5] * c[6])
           + c[2] * (c[3] * c[7] - c[4] * c[6]);
}

/* Part k from its sums, of so many pixels in all. */
static void mixture_fit(struct mixture *m, int k, const struct mixture_sums *s,
                        int64_t all)
{
    const double one = s->n ? 1.0 / (double)s->n : 0;
    double c[9];

    m->share[k] = (double)s->n / (double)all;
    if (s->n == 0)
        return;
    for (int i = 0; i < 3; i++)
        m->mean[k][i] = (double)s->sum[i] * one;
    for (int i = 0; i < 9; i++)
        c[i] = (double)s->two[i / 3][i % 3] * one
               - m->mean[k][i / 3] * m->mean[k][i % 3];
    if (mixture_det(c) <= 1e-6)         /* of one colour, or two */
        for (int i = 0; i < 9; i += 4)
            c[i] += 0.01;
    m->det[k] = mixture_det(c);
    const double d = 1.0 / m->det[k];
    double(*v)[3] = m->inverse[k];
    v[0][0] = (c[4] * c[8] - c[5] * c[7]) * d;
    v[1][0] = -(c[3] * c[8] - c[5] * c[6]) * d;
    v[2][0] = (c[3] * c[7] - c[4] * c[6]) * d;
    v[0][1] = -(c[1] * c[8] - c[2] * c[7]) * d;
    v[1][1] = (c[0] * c[8] - c[2] * c[6]) * d;
    v[2][1] = -(c[0] * c[7] - c[1] * c[6]) * d;
    v[0][2] = (c[1] * c[5] - c[2] * c[4]) * d;
    v[1][2] = -(c[0] * c[5] - c[2] * c[3]) * d;
    v[2][2] = (c[0] * c[4] - c[1] * c[3]) * d;
}

/* Density of part k at a colour, but for a factor that all have. */
static double mixture_part(const struct mixture *m, int k, const cv::Vec3b &c)
{
    const double(*v)[3] = m->inverse[k];
    double d[3], way[3];

    if (!(m->share[k] > 0))
        return 0;
    for (int i = 0; i < 3; i++)
        d[i] = c[i] - m->mean[k][i];
    for (int i = 0; i < 3; i++)
        way[i] = d[0] * v[0][i] + d[1] * v[1][i] + d[2] * v[2][i];
    return 1 / std::sqrt(m->det[k]) *
           std::exp(-0.5 * (d[0] * way[0] + d[1] * way[1] + d[2] * way[2]));
}

/* How unlikely a colour is. */
static double mixture_cost(const struct mixture *m, const cv::Vec3b &c)
{
    double sum = 0;

    for (int k = 0; k < PARTS; k++)
        sum += m->share[k] * mixture_part(m, k, c);
    return -std::log(std::max(sum, DBL_MIN));
}

/* The part that a colour is likeliest of. */
static int mixture_likeliest(const struct mixture *m, const cv::Vec3b &c)
{
    double most = 0;
    int best = 0;

    for (int k = 0; k < PARTS; k++) {
        const double p = mixture_part(m, k, c);

        if (p > most) {
            most = p;
            best = k;
        }
    }
    return best;
}

/* f(y, x) of all pixels, rows by all threads. */
template <class F> static void grabcut_each(const cv::Mat &of, F f)
{
    cv::parallel_for_(cv::Range(0, of.rows), [&](const cv::Range &rows) {
        for (int y = rows.start; y < rows.end; y++)
            for (int x = 0; x < of.cols; x++)
                f(y, x);
    });
}

/* Parts to begin with: clusters of either side's colours. */
static void grabcut_cluster(struct grabcut *g, int side)
{
    std::vector<cv::Vec3f> colour;
    std::vector<uchar *> part;
    cv::Mat cluster;

    for (int y = 0; y < g->rgb.rows; y++)
        for (int x = 0; x < g->rgb.cols; x++)
            if ((g->label.at<uchar>(y, x) & 1) == side) {
                colour.push_back(g->rgb.at<cv::Vec3b>(y, x));
                part.push_back(g->part.ptr(y) + x);
            }
    const cv::Mat rows((int)colour.size(), 3, CV_32F, colour.data());
    cv::kmeans(rows, std::min(PARTS, rows.rows), cluster,
               cv::TermCriteria(cv::TermCriteria::COUNT, 10, 0), 0,
               cv::KMEANS_PP_CENTERS);
    for (size_t i = 0; i < part.size(); i++)
        *part[i] = (uchar)cluster.at<int>((int)i);
}

/* Both mixtures from each pixel's part. */
static void grabcut_learn(struct grabcut *g)
{
    struct mixture_sums sums[2][PARTS] = {};

    for (int y = 0; y < g->rgb.rows; y++)
        for (int x = 0; x < g->rgb.cols; x++)
            mixture_sums_add(&sums[g->label.at<uchar>(y, x) & 1]
                                  [g->part.at<uchar>(y, x)],
                             g->rgb.at<cv::Vec3b>(y, x));
    for (int side = 0; side < 2; side++) {
        int64_t all = 0;

        for (int k = 0; k < PARTS; k++)
            all += sums[side][k].n;
        for (int k = 0; k < PARTS; k++)
            mixture_fit(&g->side[side], k, &sums[side][k], all);
    }
}

/* ---- the cut ------------------------------------------------------------- */

/* Neighbours that come before a pixel, as ways of struct grid_cut, and how
 * much less the slanting ones are tied. */
static const struct grabcut_neighbour {
    int dx, dy, way;
    double length;
} grabcut_before[4] = {
    {-1, 0, 3, 1}, {-1, -1, 0, std::sqrt(2.0f)}, {0, -1, 1, 1},
    {1, -1, 2, std::sqrt(2.0f)}
};

/* Squared difference of a pixel's colour and that neighbour's, or -1 where
 * there is none. */
static int grabcut_contrast(const cv::Mat &rgb, int y, int x,
                            const struct grabcut_neighbour &to)
{
    const int v = y + to.dy, u = x + to.dx;
    int sum = 0;

    if (v < 0 || u < 0 || u >= rgb.cols)
        return -1;
    const cv::Vec3b &a = rgb.at<cv::Vec3b>(y, x), &b = rgb.at<cv::Vec3b>(v, u);
    for (int k = 0; k < 3; k++)
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sum;
}

/* Neighbours are tied the more the liker their colours are, compared to what
 * is usual in the picture. */
static void grabcut_tie(struct grabcut *g)
{
    const int W = g->rgb.cols, H = g->rgb.rows;
    int64_t sum = 0;

    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            for (const auto &to : grabcut_before)
                sum += std::max(0, grabcut_contrast(g->rgb, y, x, to));
    const double pairs = 4 * W * H - 3 * W - 3 * H + 2;
    const double beta = sum ? 1 / (2 * (double)sum / pairs) : 0;
    g->tie.create(H, W, CV_32SC4);
    grabcut_each(g->rgb, [&](int y, int x) {
        for (int k = 0; k < 4; k++) {
            const int d = grabcut_contrast(g->rgb, y, x, grabcut_before[k]);
            const double tie = TIE / grabcut_before[k].length *
                               std::exp(-beta * d);

            g->tie.at<cv::Vec4i>(y, x)[k] = d < 0 ? 0
                : (int)std::lrint(UNIT * tie);
        }
    });
}

/* Undecided pixel (x,y)'s tie to what is decided: its colour's to either side,
 * the person's being the source. */
static int32_t grabcut_leaning(const struct grabcut *g, int y, int x)
{
    const cv::Vec3b &c = g->rgb.at<cv::Vec3b>(y, x);
    const double more = mixture_cost(&g->side[0], c) -
                        mixture_cost(&g->side[1], c);

    return (int32_t)std::lrint(UNIT * std::clamp(more, -DECIDED, DECIDED));
}

/* Ties of two pixels: between undecided ones, or of one to a terminal. */
static void grabcut_tie_pair(struct grid_cut *cut, const struct grabcut *g,
                             int y, int x, int k)
{
    const struct grabcut_neighbour &to = grabcut_before[k];
    const int v = y + to.dy, u = x + to.dx;
    const int32_t tie = g->tie.at<cv::Vec4i>(y, x)[k];

    if (tie == 0)
        return;
    const int a = g->label.at<uchar>(y, x), b = g->label.at<uchar>(v, u);
    if (a >= cv::GC_PR_BGD && b >= cv::GC_PR_BGD)
        grid_cut_tie(cut, (size_t)x, (size_t)y, to.way, tie);
    else if (a >= cv::GC_PR_BGD)
        grid_cut_tie_terminal(cut, (size_t)x, (size_t)y,
                              b == cv::GC_FGD ? tie : -tie);
    else if (b >= cv::GC_PR_BGD)
        grid_cut_tie_terminal(cut, (size_t)u, (size_t)v,
                              a == cv::GC_FGD ? tie : -tie);
}

/* Undecided pixels to either side, by the minimum cut. */
static void grabcut_cut(struct grabcut *g, struct grid_cut *cut)
{
    struct error err;

    grid_cut_clear(cut);
    grabcut_each(g->label, [&](int y, int x) {
        if (g->label.at<uchar>(y, x) >= cv::GC_PR_BGD)
            grid_cut_tie_terminal(cut, (size_t)x, (size_t)y,
                                  grabcut_leaning(g, y, x));
    });
    for (int y = 0; y < g->label.rows; y++)
        for (int x = 0; x < g->label.cols; x++)
            for (int k = 0; k < 4; k++)
                grabcut_tie_pair(cut, g, y, x, k);
    if (grid_cut_run(cut, &err))
        throw std::bad_alloc();
    for (int y = 0; y < g->label.rows; y++)
        for (int x = 0; x < g->label.cols; x++) {
            uchar &l = g->label.at<uchar>(y, x);

            if (l >= cv::GC_PR_BGD)
                l = grid_cut_is_source(cut, (size_t)x, (size_t)y)
                        ? cv::GC_PR_FGD : cv::GC_PR_BGD;
        }
}

void grabcut_run(cv::Mat &label, const cv::Mat &rgb, int rounds)
{
    struct grabcut g = {rgb, label, cv::Mat(label.size(), CV_8U), {}, {}};
    struct error err;
    struct grid_cut cut;

    for (int side = 0; side < 2; side++)
        grabcut_cluster(&g, side);
    grabcut_learn(&g);
    grabcut_tie(&g);
    if (grid_cut_init(&cut, (size_t)label.cols, (size_t)label.rows, &err))
        throw std::bad_alloc();
    try {
        for (int i = 0; i < rounds; i++) {
            grabcut_each(label, [&](int y, int x) {
                g.part.at<uchar>(y, x) = (uchar)mixture_likeliest(
                    &g.side[label.at<uchar>(y, x) & 1],
                    rgb.at<cv::Vec3b>(y, x));
            });
            grabcut_learn(&g);
            grabcut_cut(&g, &cut);
        }
    } catch (...) {
        grid_cut_release(&cut);
        throw;
    }
    grid_cut_release(&cut);
}
