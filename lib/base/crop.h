/* The face crop: which square of the picture the networks see, what their
 * translation means, and the sampling.  Squares are given by centre and side in
 * pixels; the centre of pixel i is i + 0.5. */
#ifndef SPID_BASE_CROP_H
#define SPID_BASE_CROP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CROP_NET 224           /* side of what the networks see */
#define CROP_GROW 1.6          /* crop side over the landmarks' larger side */
#define CROP_WINDOW 2.2        /* window side over the detector's face */

struct square {
    double x, y;               /* centre */
    double size;               /* side */
};

/* The face crop of projected landmarks xy [n,2]: centre of their bounding
 * box, side CROP_GROW times its larger side.  n > 0. */
struct square crop_from_landmarks(const float *xy, size_t n);

/* A detector's face box (centre and side) as the crop the networks know: a
 * first guess, refined by running them. */
struct square crop_from_detection(struct square face);

/* The portrait window around a face crop, for a clip whose first crop this
 * is.  (CROP_WINDOW times the detector's side, in terms of the crop.) */
struct square window_from_crop(struct square crop);

/* The same square seen from inside window, whose side becomes S pixels; and
 * back.  Points follow the same rule. */
struct square square_into(struct square q, struct square window, double S);
/* And back out of the window. */
struct square square_out_of(struct square q, struct square window, double S);

/* A rectangle of pixels: columns x[0] to x[1] - 1 of rows y[0] to y[1] - 1. */
struct extent {
    size_t x[2], y[2];
};

static inline bool extent_has(const struct extent *e, size_t x, size_t y)
{
    return x >= e->x[0] && x < e->x[1] && y >= e->y[0] && y < e->y[1];
}

static inline bool extent_is_empty(const struct extent *e)
{
    return e->x[0] >= e->x[1] || e->y[0] >= e->y[1];
}

/* Of the square's n x n pixels those whose middles lie in a picture of W x H;
 * beyond its border alone: empty. */
struct extent square_extent(size_t n, size_t W, size_t H, struct square q);
/* Of n x n pixels those within e, as pixels of w x w over the same square that
 * are so wholly. */
struct extent extent_resize(struct extent e, size_t n, size_t w);
/* Pixels of rgb (n,n,step), of which the first three numbers count, that are
 * not in e become the nearest one that is: what the matte network sees beyond a
 * picture's edges.  Where e is empty, none. */
void extent_repeat_edges(float *rgb, size_t n, size_t step, struct extent e);

/* The network's translation t' (relative to the crop, as if the crop were a
 * whole picture of S pixels) to the portrait window's t, and back.  crop is in
 * window pixels, focal = 12 S / 2.  Exact inverses of each other; see crop.c
 * for the derivation and what is neglected. */
void crop_translation(double t[3], const double tnet[3], struct square crop,
                      double S, double focal);
/* What the network would have said, from t. */
void crop_translation_inverse(double tnet[3], const double t[3],
                              struct square crop, double S, double focal);
/* Gradient: adds to gtnet[3] and gcrop[3] (x, y, size) from gt = dL/dt. */
void crop_translation_backward(double gtnet[3], double gcrop[3],
                               const double gt[3], const double tnet[3],
                               struct square crop, double S, double focal);

/* out [n,n,3] f32 in [0,1] = the square of an 8-bit picture [H,W,3], bilinear,
 * black outside.  stride is bytes from row to row. */
void crop_sample_u8(float *out, size_t n, const uint8_t *rgb, size_t W,
                    size_t H, size_t stride, struct square q);
/* Plain double reference of it, of numbers in [0,1]. */
void crop_sample_ref(double *out, size_t n, const double *rgb, size_t W,
                     size_t H, struct square q);

/* out [h,w,3] = means of 2 x 2 pixels of rgb [2h,2w,3], of which rows are
 * stride and stride_in bytes apart. */
void crop_halve(uint8_t *out, const uint8_t *rgb, size_t w, size_t h,
                size_t stride, size_t stride_in);

/* The square of an 8-bit picture as n x n 8-bit pixels, antialiased when it
 * shrinks, black beyond square_extent and nowhere mixed with it: the
 * portrait window and the source crop.  channels is 1 to 4.  -1 when out of
 * memory. */
int crop_resize_u8(uint8_t *out, size_t n, const uint8_t *rgb, size_t W,
                   size_t H, size_t stride, int channels, struct square q);

#endif
