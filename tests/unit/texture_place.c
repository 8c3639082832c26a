/* Places in the source picture: the view between two cameras is exact for the
 * plane that faces the source's, and a place comes back through any view. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/base/neck_blend.h"
#include "lib/base/rotation.h"
#include "lib/base/gaussians.h"
#include "lib/photo/place.h"
#include "tests/check.h"

enum { N = 64 };

/* The frontal camera at distance z, turned by axis-angle a about the head and
 * then rolled in the picture. */
static void place_rotated(float cam[12], const float a[3], float roll, float z)
{
    const float front[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
    const float axis[3] = {0, 0, roll};
    const float t[3] = {0.15f, -0.1f, z};
    float R[9], turn[9], spin[9], both[9];

    rotation_exp(turn, a);
    rotation_exp(spin, axis);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            both[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                both[3 * i + j] += spin[3 * i + k] * front[3 * k + j];
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            R[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                R[3 * i + j] += both[3 * i + k] * turn[3 * k + j];
        }
    camera_make(cam, R, t);
}

/* Points of the plane through the head's origin that faces cam; depth: this
 * far before or behind it at most. */
static void place_facing(float *mean, const float cam[12], double depth,
                         struct random *r)
{
    for (size_t i = 0; i < N; i++) {
        float c[3] = {(float)random_range(r, -0.7, 0.7),
                      (float)random_range(r, -0.7, 0.7),
                      (float)random_range(r, -depth, depth)};

        for (int j = 0; j < 3; j++)      /* R^T c */
            mean[3 * i + j] = cam[j] * c[0] + cam[4 + j] * c[1] +
                              cam[8 + j] * c[2];
    }
}

/* What is blended of places, out (N,3): how far uv is from where the view puts
 * the driven centres, and 1, each times seen. */
static void place_channels(float *out, const float *mean, const float *uv,
                           const float *seen, const struct splat_place_view *v,
                           const float cam[12])
{
    float n[2 * N];

    camera_project(n, NULL, cam, 2, mean, N);
    for (size_t i = 0; i < N; i++) {
        const float x = n[2 * i] - 1, y = n[2 * i + 1] - 1;

        for (size_t k = 0; k < 2; k++)
            out[3 * i + k] = seen[i] * (2 * uv[2 * i + k] - 1 - v->A[2 * k] * x -
                                        v->A[2 * k + 1] * y - v->b[k]);
        out[3 * i + 2] = seen[i];
    }
}

/* Largest offset of points that lie up to depth before and behind the plane,
 * placed by source and driven to cam, normalised. */
static double largest_offset(const float source[12], const float cam[12],
                             double depth)
{
    const float scale[3 * N] = {0};
    float mean[3 * N], uv[2 * N], seen[N], out[3 * N];
    struct splat_place_view v;
    struct random r;
    double worst = 0;

    random_init(&r, 3, "facing");
    place_facing(mean, source, depth, &r);
    for (size_t i = 0; i < N; i++)
        seen[i] = 1;
    place_of_source(uv, seen, mean, scale, source, N);
    place_view_make(&v, source, cam, NULL);
    place_channels(out, mean, uv, seen, &v, cam);
    for (size_t i = 0; i < N; i++)
        worst = fmax(worst, fmax(fabsf(out[3 * i]), fabsf(out[3 * i + 1])));
    return worst;
}

static void place_planes(void)
{
    const float look[3] = {0.1f, -0.3f, 0.05f};
    float source[12], cam[12], yaw[3];

    place_rotated(source, look, 0.2f, 12);
    check("source's own view: no offset, at any depth",
          largest_offset(source, source, 0.6), 2e-6);
    place_rotated(cam, look, 0.2f, 18);
    check("further away: none in the plane",
          largest_offset(source, cam, 0), 2e-6);
    place_rotated(cam, look, -0.9f, 8);
    check("rolled and nearer: none in the plane",
          largest_offset(source, cam, 0), 2e-6);
    memcpy(yaw, look, sizeof yaw);
    yaw[1] += 0.5f;
    place_rotated(cam, yaw, 0.2f, 12);
    /* a point that is 0.7 to the side comes 0.7 sin 29 degrees nearer: 3 % of
     * its distance from the middle, 0.7 */
    check("turned: of the plane what perspective adds",
          largest_offset(source, cam, 0), 0.04);
    check_that("turned: points before the plane have more",
               largest_offset(source, cam, 0.6) > 0.1);
}

/* How far from the truth a Gaussian in the middle of a slope puts the points
 * about it, normalised; with `flat` as if it faced the source's camera. */
static double slope_error(const float source[12], const float cam[12],
                          const float tilt[2], bool flat)
{
    struct splat_place_view v;
    float mean[3 * N], uv[2 * N], n[2 * N];
    struct random r;
    double at[2], worst = 0;

    random_init(&r, 5, "slope");
    for (size_t i = 0; i < N; i++) {
        const float x = i ? (float)random_range(&r, -0.1, 0.1) : 0;
        const float y = i ? (float)random_range(&r, -0.1, 0.1) : 0;
        const float z = tilt[0] * x + tilt[1] * y;

        for (size_t k = 0; k < 3; k++)
            mean[3 * i + k] = x * source[k] + y * source[4 + k] +
                              z * source[8 + k];
    }
    place_view_make(&v, source, cam, NULL);
    camera_project(uv, NULL, source, 2, mean, N);
    camera_project(n, NULL, cam, 2, mean, N);
    const struct splat_place_side side = splat_place_side(&v);
    const float s = flat ? 0
        : splat_place_shorter(gaussian_more(tilt, v.toward) - 1, side.facing);
    float p[SPLAT_PLACE_CHANNELS] = {0, 0, 0.7f, 0.7f * s};

    splat_place_at(at, &v, n[0] - 1, n[1] - 1);
    const double along = s * (side.e[0] * at[0] + side.e[1] * at[1]);
    for (int k = 0; k < 2; k++)
        p[k] = 0.7f * (float)(uv[k] - 1 - at[k] + along * side.e[k]);
    for (size_t i = 0; i < N; i++) {
        splat_place_at(at, &v, n[2 * i] - 1, n[2 * i + 1] - 1);
        splat_place_blended(at, &side, p);
        for (size_t k = 0; k < 2; k++)
            worst = fmax(worst, fabs(at[k] - (uv[2 * i + k] - 1)));
    }
    return worst;
}

/* Slopes along the way that the camera has gone, either way. */
static void place_slopes(void)
{
    const float look[3] = {0.1f, -0.3f, 0};
    float source[12], cam[12];
    double exact = 0, flat = 1;

    place_rotated(source, look, 0, 12);
    for (int way = -1; way <= 1; way += 2)
        for (int axis = 0; axis < 2; axis++)
            for (float slope = -0.8f; slope < 2.5f; slope += 1.6f) {
                float turned[3] = {look[0], look[1], look[2]}, tilt[2] = {0};
                struct splat_place_view v;

                turned[1 - axis] += 0.4f * (float)way;
                place_rotated(cam, turned, 0, 12);
                place_view_make(&v, source, cam, NULL);
                const float size = hypotf(v.toward[0], v.toward[1]);
                for (int k = 0; k < 2; k++)
                    tilt[k] = slope * v.toward[k] / size;
                exact = fmax(exact, slope_error(source, cam, tilt, false));
                flat = fmin(flat, slope_error(source, cam, tilt, true));
            }
    check("on a slope: what perspective adds", exact, 6e-3);
    check_that("as if it were flat: four times that and more",
               flat > 4 * exact);
}

/* A uv, through the offsets and back by the view. */
static void round_trip(void)
{
    float source[12], cam[12], mean[3 * N], uv[2 * N], seen[N], out[3 * N];
    struct splat_place_view v;
    struct random r;
    double worst = 0;

    random_init(&r, 4, "round trip");
    for (int rep = 0; rep < 50; rep++) {
        float a[3], n[2 * N];

        for (int i = 0; i < 3; i++)
            a[i] = (float)random_range(&r, -0.5, 0.5);
        place_rotated(source, a, (float)random_range(&r, -1, 1), 12);
        for (int i = 0; i < 3; i++)
            a[i] += (float)random_range(&r, -0.6, 0.6);
        float far = (float)random_range(&r, 8, 20);

        place_rotated(cam, a, (float)random_range(&r, -1, 1), far);
        place_facing(mean, source, 0.6, &r);
        for (size_t i = 0; i < N; i++) {
            uv[2 * i] = (float)random_uniform(&r);
            uv[2 * i + 1] = (float)random_uniform(&r);
            seen[i] = (float)random_range(&r, 0.2, 1);
        }
        place_view_make(&v, source, cam, NULL);
        place_channels(out, mean, uv, seen, &v, cam);
        camera_project(n, NULL, cam, 2, mean, N);
        for (size_t i = 0; i < N; i++) {
            double x = n[2 * i] - 1, y = n[2 * i + 1] - 1;
            double u = v.A[0] * x + v.A[1] * y + v.b[0] + out[3 * i] / seen[i];
            double w = v.A[2] * x + v.A[3] * y + v.b[1] +
                       out[3 * i + 1] / seen[i];

            worst = fmax(worst, fabs(0.5 * (u + 1) - uv[2 * i]));
            worst = fmax(worst, fabs(0.5 * (w + 1) - uv[2 * i + 1]));
            worst = fmax(worst, fabs((double)out[3 * i + 2] - seen[i]));
        }
    }
    check("scaled, rolled, turned: the place comes back", worst, 3e-6);
}

/* A head turns by 50 degrees and comes nearer, its shoulders stay: the view
 * takes theirs, of the plane that faced the source's camera, to where that saw
 * them, and the head to where it does without shoulders. */
static void place_shoulders(void)
{
    const float look[3] = {0.1f, -0.3f, 0.05f}, pivot[3] = {0, -0.2f, -0.1f};
    const float rotated[3] = {0.15f, 0.6f, 0.05f};
    float source[12], cam[12], body[12], from[9], mean[3 * N], driven[3 * N];
    float was[2 * N], is[2 * N], weight[N];
    struct splat_place_view v, head;
    struct random r;
    double low = 0, high = 0;
    size_t lows = 0, highs = 0;

    random_init(&r, 5, "shoulders");
    place_rotated(source, look, 0.2f, 12);
    place_rotated(cam, rotated, 0.1f, 11);
    for (int i = 0; i < 9; i++)
        from[i] = source[4 * (i / 3) + i % 3];
    neck_blend_body(body, pivot, from, cam);
    place_view_make(&head, source, cam, NULL);
    place_view_make(&v, source, cam,
                    &(struct place_shoulders){body, pivot});
    place_facing(mean, source, 0, &r);
    for (size_t i = 0; i < N; i++)
        weight[i] = 1;
    neck_blend_points(driven, mean, weight, N, body);
    camera_project(was, NULL, source, 2, mean, N);
    camera_project(is, NULL, cam, 2, driven, N);
    for (size_t i = 0; i < N; i++) {
        const double x = is[2 * i] - 1, y = is[2 * i + 1] - 1;
        const double share = v.neck[0] * x + v.neck[1] * y + v.neck[2];
        double at[2], alone[2];

        splat_place_at(at, &v, x, y);
        splat_place_at(alone, &head, x, y);
        for (size_t k = 0; k < 2 && share >= 1; k++)
            low = fmax(low, fabs(at[k] + 1 - was[2 * i + k]));
        for (size_t k = 0; k < 2 && share <= 0; k++)
            high = fmax(high, fabs(at[k] - alone[k]));
        lows += share >= 1;
        highs += share <= 0;
    }
    check_that("shoulders: below the neck and above", lows > 8 && highs > 8);
    check("shoulders: theirs where the source saw them", low, 2e-6);
    check("shoulders: the head's as without", high, 0);
}

/* From the side and from behind the map stays small. */
static void place_steep(void)
{
    const float none[3] = {0};
    float source[12], cam[12], largest = 0;
    bool finite = true;

    place_rotated(source, none, 0, 12);
    for (int degrees = 60; degrees <= 180; degrees += 5) {
        float a[3] = {0, (float)degrees * 0.01745329f, 0};
        struct splat_place_view v;

        place_rotated(cam, a, 0, 12);
        place_view_make(&v, source, cam, NULL);
        for (int i = 0; i < 4; i++) {
            finite = finite && isfinite(v.A[i]);
            largest = fmaxf(largest, fabsf(v.A[i]));
        }
        finite = finite && isfinite(v.b[0]) && isfinite(v.b[1]);
    }
    check_that("from 60 to 180 degrees: numbers", finite);
    check("from 60 to 180 degrees: largest entry of the map", largest,
          1 / 0.35 + 1e-4);
}

/* What lies outside of the picture was not seen. */
static void place_outside(void)
{
    const float none[3] = {0};
    float cam[12], uv[8], seen[4] = {0.5f, 1, 1, 1};
    const float mean[12] = {0, 0, 0, 3, 0, 0, 0, -3, 0, 0, 0, 30};
    const float scale[12] = {0.1f, 0.1f, 0.1f, 0.1f, 0.1f, 0.1f,
                             0.1f, 0.1f, 0.1f, 0.1f, 0.1f, 0.1f};

    place_rotated(cam, none, 0, 12);
    place_of_source(uv, seen, mean, scale, cam, 4);
    check_that("inside: seen as before", seen[0] == 0.5f);
    check_that("beside, below and behind: not seen",
               seen[1] == 0 && seen[2] == 0 && seen[3] == 0);
    expect("place by hand, x", uv[0], 0.5 + 6 * 0.15 / 12, 1e-6);
    expect("place by hand, y", uv[1], 0.5 - 6 * 0.1 / 12, 1e-6);
}

int main(void)
{
    place_planes();
    place_slopes();
    round_trip();
    place_shoulders();
    place_steep();
    place_outside();
    return check_status();
}
