/* GrabCut (Rother, Kolmogorov, Blake 2004) with the minimum cut of
 * lib/geom/grid_cut.h.  Sums and formulae are in cv::grabCut's order, so that
 * labels are the same. */
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

/* The first two are the paper's and cv::grabCut's. */
static const int COMPONENTS = 5;        /* Gaussians of a mixture */
static const double GAMMA = 50;         /* edge capacity of equal colours */
/* Of a terminal's edge, at most: above the sum of a pixel's eight others. */
static const double LAMBDA = 1000;
/* Capacities are whole numbers of 1 / UNIT. */
static const double UNIT = 1 << 20;

/* ---- colour models ------------------------------------------------------- */

/* Sums over the colours of a component: integers, so the order does not
 * matter. */
struct mixture_sums {
    int64_t n, sum[3], product[3][3];
};

/* A mixture of Gaussians over RGB, 0..255. */
struct mixture {
    double share[COMPONENTS];           /* sum to 1 */
    double mean[COMPONENTS][3];
    double inverse[COMPONENTS][3][3];   /* of the covariance */
    double det[COMPONENTS];             /* of the covariance */
};

struct grabcut {
    cv::Mat rgb;                        /* (H, W) CV_8UC3 */
    cv::Mat label;                      /* (H, W) CV_8U, GC_* */
    cv::Mat component;                  /* (H, W) CV_8U: each pixel's, of its
                                         * side's mixture */
    cv::Mat link;                       /* (H, W) CV_32SC4: capacities of the
                                         * edges to grabcut_neighbours */
    struct mixture side[2];             /* by label & 1: background, person */
};

static void mixture_sums_add(struct mixture_sums *s, const cv::Vec3b &c)
{
    s->n++;
    for (int i = 0; i < 3; i++) {
        s->sum[i] += c[i];
        for (int j = 0; j < 3; j++)
            s->product[i][j] += c[i] * c[j];
    }
}

/* Determinant of a symmetric matrix, row by row. */
static double mixture_det(const double c[9])
{
    return c[0] * (c[4] * c[8] - c[5] * c[7])
           - c[1] * (c[3] * c[8] - c[5] * c[6])
           + c[2] * (c[3] * c[7] - c[4] * c[6]);
}

/* Component k from its sums; all: pixels of its side. */
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
        c[i] = (double)s->product[i / 3][i % 3] * one
               - m->mean[k][i / 3] * m->mean[k][i % 3];
    if (mixture_det(c) <= 1e-6)         /* colours on a plane */
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

/* Density of component k at a colour, without the constant (2 pi)^(-3/2). */
static double mixture_density(const struct mixture *m, int k,
                              const cv::Vec3b &c)
{
    const double(*v)[3] = m->inverse[k];
    double d[3], dv[3];

    if (!(m->share[k] > 0))
        return 0;
    for (int i = 0; i < 3; i++)
        d[i] = c[i] - m->mean[k][i];
    for (int i = 0; i < 3; i++)
        dv[i] = d[0] * v[0][i] + d[1] * v[1][i] + d[2] * v[2][i];
    return 1 / std::sqrt(m->det[k]) *
           std::exp(-0.5 * (d[0] * dv[0] + d[1] * dv[1] + d[2] * dv[2]));
}

/* Negative log-likelihood of a colour. */
static double mixture_cost(const struct mixture *m, const cv::Vec3b &c)
{
    double sum = 0;

    for (int k = 0; k < COMPONENTS; k++)
        sum += m->share[k] * mixture_density(m, k, c);
    return -std::log(std::max(sum, DBL_MIN));
}

/* The component with the greatest density at a colour. */
static int mixture_assign(const struct mixture *m, const cv::Vec3b &c)
{
    double most = 0;
    int best = 0;

    for (int k = 0; k < COMPONENTS; k++) {
        const double p = mixture_density(m, k, c);

        if (p > most) {
            most = p;
            best = k;
        }
    }
    return best;
}

/* Call f(y, x) for all pixels, with rows shared among threads. */
template <class F> static void grabcut_each(const cv::Mat &of, F f)
{
    cv::parallel_for_(cv::Range(0, of.rows), [&](const cv::Range &rows) {
        for (int y = rows.start; y < rows.end; y++)
            for (int x = 0; x < of.cols; x++)
                f(y, x);
    });
}

/* First components of a side's pixels: clusters of their colours. */
static void grabcut_cluster(struct grabcut *g, int side)
{
    std::vector<cv::Vec3f> colour;
    std::vector<uchar *> component;
    cv::Mat cluster;

    for (int y = 0; y < g->rgb.rows; y++)
        for (int x = 0; x < g->rgb.cols; x++)
            if ((g->label.at<uchar>(y, x) & 1) == side) {
                colour.push_back(g->rgb.at<cv::Vec3b>(y, x));
                component.push_back(g->component.ptr(y) + x);
            }
    const cv::Mat rows((int)colour.size(), 3, CV_32F, colour.data());
    cv::kmeans(rows, std::min(COMPONENTS, rows.rows), cluster,
               cv::TermCriteria(cv::TermCriteria::COUNT, 10, 0), 0,
               cv::KMEANS_PP_CENTERS);
    for (size_t i = 0; i < component.size(); i++)
        *component[i] = (uchar)cluster.at<int>((int)i);
}

/* Both mixtures from the pixels' components. */
static void grabcut_learn(struct grabcut *g)
{
    struct mixture_sums sums[2][COMPONENTS] = {};

    for (int y = 0; y < g->rgb.rows; y++)
        for (int x = 0; x < g->rgb.cols; x++)
            mixture_sums_add(&sums[g->label.at<uchar>(y, x) & 1]
                                  [g->component.at<uchar>(y, x)],
                             g->rgb.at<cv::Vec3b>(y, x));
    for (int side = 0; side < 2; side++) {
        int64_t all = 0;

        for (int k = 0; k < COMPONENTS; k++)
            all += sums[side][k].n;
        for (int k = 0; k < COMPONENTS; k++)
            mixture_fit(&g->side[side], k, &sums[side][k], all);
    }
}

/* ---- the cut ------------------------------------------------------------- */

/* The neighbours that precede a pixel in reading order, so that each edge is
 * made once. */
static const struct grabcut_neighbour {
    int dx, dy;
    int dir;                            /* of grid_cut_link */
    double length;                      /* pixels */
} grabcut_neighbours[4] = {
    {-1, 0, 3, 1}, {-1, -1, 0, std::sqrt(2.0f)}, {0, -1, 1, 1},
    {1, -1, 2, std::sqrt(2.0f)}
};

/* Squared difference of a pixel's colour and that neighbour's; -1 outside the
 * picture. */
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

/* Capacities between neighbours: GAMMA / length exp(-beta d), d the squared
 * difference of their colours, 1 / beta twice its mean over the picture. */
static void grabcut_link_all(struct grabcut *g)
{
    const int W = g->rgb.cols, H = g->rgb.rows;
    int64_t sum = 0;

    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            for (const auto &to : grabcut_neighbours)
                sum += std::max(0, grabcut_contrast(g->rgb, y, x, to));
    const double pairs = 4 * W * H - 3 * W - 3 * H + 2;
    const double beta = sum ? 1 / (2 * (double)sum / pairs) : 0;
    g->link.create(H, W, CV_32SC4);
    grabcut_each(g->rgb, [&](int y, int x) {
        for (int k = 0; k < 4; k++) {
            const int d = grabcut_contrast(g->rgb, y, x, grabcut_neighbours[k]);
            const double capacity = GAMMA / grabcut_neighbours[k].length *
                                    std::exp(-beta * d);

            g->link.at<cv::Vec4i>(y, x)[k] = d < 0 ? 0
                : (int)std::lrint(UNIT * capacity);
        }
    });
}

/* Capacity between an undecided pixel (x,y) and the source (the person) or,
 * negative, the sink (the background): the difference of its costs. */
static int32_t grabcut_terminal_capacity(const struct grabcut *g, int y, int x)
{
    const cv::Vec3b &c = g->rgb.at<cv::Vec3b>(y, x);
    const double more = mixture_cost(&g->side[0], c) -
                        mixture_cost(&g->side[1], c);

    return (int32_t)std::lrint(UNIT * std::clamp(more, -LAMBDA, LAMBDA));
}

/* The edge of (x,y) with its neighbour k.  A decided pixel counts as its
 * terminal; between two decided ones there is no edge. */
static void grabcut_link_pair(struct grid_cut *cut, const struct grabcut *g,
                              int y, int x, int k)
{
    const struct grabcut_neighbour &to = grabcut_neighbours[k];
    const int v = y + to.dy, u = x + to.dx;
    const int32_t capacity = g->link.at<cv::Vec4i>(y, x)[k];

    if (capacity == 0)
        return;
    const int a = g->label.at<uchar>(y, x), b = g->label.at<uchar>(v, u);
    if (a >= cv::GC_PR_BGD && b >= cv::GC_PR_BGD)
        grid_cut_link(cut, (size_t)x, (size_t)y, to.dir, capacity);
    else if (a >= cv::GC_PR_BGD)
        grid_cut_link_terminal(cut, (size_t)x, (size_t)y,
                              b == cv::GC_FGD ? capacity : -capacity);
    else if (b >= cv::GC_PR_BGD)
        grid_cut_link_terminal(cut, (size_t)u, (size_t)v,
                              a == cv::GC_FGD ? capacity : -capacity);
}

/* Label the undecided pixels by the minimum cut. */
static void grabcut_cut(struct grabcut *g, struct grid_cut *cut)
{
    struct error err;

    grid_cut_clear(cut);
    grabcut_each(g->label, [&](int y, int x) {
        if (g->label.at<uchar>(y, x) >= cv::GC_PR_BGD)
            grid_cut_link_terminal(cut, (size_t)x, (size_t)y,
                                  grabcut_terminal_capacity(g, y, x));
    });
    for (int y = 0; y < g->label.rows; y++)
        for (int x = 0; x < g->label.cols; x++)
            for (int k = 0; k < 4; k++)
                grabcut_link_pair(cut, g, y, x, k);
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
    grabcut_link_all(&g);
    if (grid_cut_init(&cut, (size_t)label.cols, (size_t)label.rows, &err))
        throw std::bad_alloc();
    try {
        for (int i = 0; i < rounds; i++) {
            grabcut_each(label, [&](int y, int x) {
                g.component.at<uchar>(y, x) = (uchar)mixture_assign(
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
