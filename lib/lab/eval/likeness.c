/* ArcFace's protocol: five points of a face, taken from the tracked head's
 * landmarks, are aligned to a template; the cosine of two embeddings is the
 * likeness. */
#include "lib/lab/eval/likeness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"

#define SIDE IRESNET_SIDE

int likeness_init(struct likeness *l, const char *weights,
                  const struct model *model, const struct head *head,
                  struct error *err)
{
    memset(l, 0, sizeof *l);
    if (iresnet_open(&l->net, weights, err))
        return -1;
    size_t n = iresnet_size(&l->net);
    l->face = malloc((3 * SIDE * SIDE + 3 * n) * sizeof *l->face);
    if (!l->face) {
        likeness_release(l);
        return error_set(err, EX_OSERR, "out of memory");
    }
    l->code[0] = l->face + 3 * SIDE * SIDE;
    l->code[1] = l->code[0] + n;
    l->source = l->code[1] + n;
    if (!model || !head)
        return 0;
    if (encoders_open(&l->encoders, model, false, NN_F32, err) ||
        head_fold(&l->id, head, NULL, 0, err)) {
        likeness_release(l);
        return -1;
    }
    l->size = (double)model->config.size;
    l->has_tracker = true;
    return 0;
}

/* Forget both clips' tracking. */
static void likeness_drop_clips(struct likeness *l)
{
    for (int k = 0; k < LIKENESS_CLIPS; k++) {
        if (l->open[k])
            track_release(&l->track[k]);
        l->open[k] = l->following[k] = false;
    }
}

void likeness_release(struct likeness *l)
{
    likeness_drop_clips(l);
    if (l->has_tracker)
        encoders_release(&l->encoders);
    identity_release(&l->id);
    iresnet_release(&l->net);
    free(l->face);
    memset(l, 0, sizeof *l);
}

/* ---- alignment ---------------------------------------------------------- */

/* The similarity M (2,3), from aligned to picture pixels, that takes the five
 * points of the public training crops closest to these (5,2): eyes (left in
 * the picture first), nose, corners of the mouth.  Least squares of
 * x -> a x - b y + tx, y -> b x + a y + ty. */
static void likeness_align(double M[6], const double points[10])
{
    static const double at[10] = {38.2946, 51.6963, 73.5318, 51.5014,
                                  56.0252, 71.7366, 41.5493, 92.3655,
                                  70.7299, 92.2041};
    double mx = 0, my = 0, ux = 0, uy = 0, aa = 0, bb = 0, ss = 0;

    for (int i = 0; i < 5; i++) {
        mx += at[2 * i] / 5;
        my += at[2 * i + 1] / 5;
        ux += points[2 * i] / 5;
        uy += points[2 * i + 1] / 5;
    }
    for (int i = 0; i < 5; i++) {
        double x = at[2 * i] - mx, y = at[2 * i + 1] - my;
        double u = points[2 * i] - ux, v = points[2 * i + 1] - uy;

        aa += x * u + y * v;
        bb += x * v - y * u;
        ss += x * x + y * y;
    }
    double a = aa / ss, b = bb / ss;
    const double out[6] = {a, -b, ux - a * mx + b * my,
                           b, a, uy - b * mx - a * my};
    memcpy(M, out, sizeof out);
}

/* Eyes, nose and mouth of 68 landmarks in window pixels, in picture pixels. */
static void likeness_five_points(double p[10],
                                 const float uv[2 * HEAD_LANDMARKS],
                                 const struct track *t)
{
    static const int first[5] = {36, 42, 30, 48, 54};
    static const int count[5] = {6, 6, 1, 1, 1};
    double scale = t->window.size / t->opt.size;
    double corner[2] = {t->window.x - t->window.size / 2,
                        t->window.y - t->window.size / 2};

    for (int i = 0; i < 5; i++)
        for (int c = 0; c < 2; c++) {
            double sum = 0;

            for (int k = 0; k < count[i]; k++)
                sum += uv[2 * (first[i] + k) + c];
            p[2 * i + c] = corner[c] + scale * sum / count[i];
        }
}

/* A channel of a pixel, black outside. */
static double likeness_pixel(const uint8_t *rgb, long W, long H, long x,
                             long y, long c)
{
    return x < 0 || y < 0 || x >= W || y >= H ? 0 : rgb[3 * (y * W + x) + c];
}

/* face (112,112,3) in [-1,1], bilinear, black outside; as the public code
 * counts: pixel i lies at i. */
static void likeness_cut(float *face, const uint8_t *rgb, size_t W, size_t H,
                         const double M[6])
{
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        double x = (double)(i % SIDE), y = (double)(i / SIDE);
        double u = M[0] * x + M[1] * y + M[2], v = M[3] * x + M[4] * y + M[5];
        long x0 = (long)floor(u), y0 = (long)floor(v);
        double fx = u - (double)x0, fy = v - (double)y0;

        for (long c = 0; c < 3; c++) {
            const long w = (long)W, h = (long)H;
            double top = (1 - fx) * likeness_pixel(rgb, w, h, x0, y0, c) +
                         fx * likeness_pixel(rgb, w, h, x0 + 1, y0, c);
            double low = (1 - fx) * likeness_pixel(rgb, w, h, x0, y0 + 1, c) +
                         fx * likeness_pixel(rgb, w, h, x0 + 1, y0 + 1, c);

            face[3 * i + (size_t)c] =
                (float)(((1 - fy) * top + fy * low) / 127.5 - 1);
        }
    }
}

/* ---- clips -------------------------------------------------------------- */

/* Find the face of clip k in a frame, aligned into l->face: 1, 0 none, -1. */
static int likeness_follow(struct likeness *l, int k, const uint8_t *rgb,
                           size_t W, size_t H, double time, struct error *err)
{
    const struct frame f = {.width = W, .height = H, .rgb = rgb,
                            .time = time};
    const struct track_options opt = {.size = l->size};
    struct track *t = &l->track[k];
    struct track_result r;
    float uv[2 * HEAD_LANDMARKS];
    double points[10], M[6];
    int found = 1;

    if (!l->has_tracker)
        return error_set(err, EX_NOINPUT, "faces of %zux%zu pixels need a "
                         "model to find them (expected -m MODEL, or aligned "
                         "faces of 112x112)", W, H);
    if (!l->open[k] &&
        track_init(t, &l->id, &l->encoders.motion, &opt, err))
        return -1;
    l->open[k] = true;
    if (!l->following[k])
        found = track_start(t, &r, &f, NULL, err);
    else if (track_step(t, &r, &f, err))
        found = -1;
    if (found <= 0)
        return found;
    l->following[k] = true;
    if (r.lost)
        return 0;
    track_project(uv, t, &r.motion);
    likeness_five_points(points, uv, t);
    likeness_align(M, points);
    likeness_cut(l->face, rgb, W, H, M);
    return 1;
}

/* The embedding of a frame's face: 1, 0 none, -1. */
static int likeness_embed_face(float *code, struct likeness *l, int k,
                               const uint8_t *rgb, size_t W, size_t H,
                               double time, struct error *err)
{
    static const double straight[6] = {1, 0, 0, 0, 1, 0};
    int found = 1;

    if (W == SIDE && H == SIDE)
        likeness_cut(l->face, rgb, W, H, straight);
    else
        found = likeness_follow(l, k, rgb, W, H, time, err);
    if (found > 0)
        iresnet_forward(code, l->face, &l->net);
    return found;
}

int likeness_start(struct likeness *l, const char *source, struct error *err)
{
    struct image picture = {0};
    int found;

    likeness_drop_clips(l);
    l->has_source = false;
    if (!source)
        return 0;
    if (image_read(&picture, source, err))
        return -1;
    found = likeness_embed_face(l->source, l, 0, picture.rgb, picture.width,
                                picture.height, 0, err);
    image_release(&picture);
    likeness_drop_clips(l);
    if (found == 0)
        error_set(err, EX_DATAERR, "%s: no face found", source);
    l->has_source = found > 0;
    return found > 0 ? 0 : -1;
}

int likeness_embed(struct likeness *l, int k, const uint8_t *rgb, size_t W,
                   size_t H, double time, struct error *err)
{
    return likeness_embed_face(l->code[k], l, k, rgb, W, H, time, err);
}

/* Of two vectors of unit length. */
static double likeness_cosine(const float *a, const float *b, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += (double)a[i] * b[i];
    return sum;
}

double likeness_pair(const struct likeness *l)
{
    return likeness_cosine(l->code[0], l->code[1], iresnet_size(&l->net));
}

double likeness_source(const struct likeness *l)
{
    return l->has_source
               ? likeness_cosine(l->source, l->code[1], iresnet_size(&l->net))
               : NAN;
}
