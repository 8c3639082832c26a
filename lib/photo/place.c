/* Places of Gaussians in the source picture (place.h): the affine view and
 * the offsets from it, forward and backward. */
#include "lib/photo/place.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/parallel.h"

/* Heights above the neck's pivot, head units, between which the head's map goes
 * over into the shoulders'.  Any two give true places; between these lies what
 * is seen of a neck.  -0.03 and 0.03, 0 and 0.05, -0.07 and 0.07 change no frame
 * of three validation people by 0.1 dB (tests/bench/turned.sh). */
#define PLACE_NECK_TOP 0.1f
#define PLACE_NECK_BOTTOM 0.03f

/* Top left 2x2 of R R_s^T: how the source's image plane lies in the frame's
 * picture. */
static void place_plane(float P[4], const float source[12],
                        const float cam[12])
{
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) {
            P[2 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                P[2 * i + j] += cam[4 * i + k] * source[4 * j + k];
        }
}

/* Where the head's origin is seen, normalised. */
static void place_origin(float o[2], const float cam[12])
{
    float z = fmaxf(cam[11], CAMERA_NEAR);

    o[0] = CAMERA_FOCAL * cam[3] / z;
    o[1] = CAMERA_FOCAL * cam[7] / z;
}

/* map (6), A before b: from what a frame's camera sees of a plane through the
 * head, or the shoulders, to where the source's saw it. */
static void place_map(float map[6], const float source[12],
                      const float cam[12])
{
    float P[4], from[2], to[2];
    float scale = fmaxf(cam[11], CAMERA_NEAR) /
                  fmaxf(source[11], CAMERA_NEAR);

    place_plane(P, source, cam);
    float det = P[0] * P[3] - P[1] * P[2];
    /* steeper than that, the map of the steepest plane that is allowed */
    float inv = scale / fmaxf(det, SPLAT_PLACE_STEEPEST);
    map[0] = P[3] * inv;
    map[1] = -P[1] * inv;
    map[2] = -P[2] * inv;
    map[3] = P[0] * inv;
    place_origin(from, source);
    place_origin(to, cam);
    map[4] = from[0] - map[0] * to[0] - map[1] * to[1];
    map[5] = from[1] - map[2] * to[0] - map[3] * to[1];
}

/* v's shoulders and neck; head (6): the map of the head. */
static void place_set_shoulders(struct splat_place_view *v,
                                const float head[6], const float source[12],
                                const float cam[12],
                                const struct place_shoulders *s)
{
    float seen[12], map[6], ends[6], end[4], down[2];

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            seen[4 * i + j] = j == 3 ? cam[4 * i + 3] : 0;
            for (int k = 0; k < 3; k++)
                seen[4 * i + j] += cam[4 * i + k] * s->body[4 * k + j];
        }
    place_map(map, source, seen);
    for (int i = 0; i < 6; i++)
        v->shoulders[i] = map[i] - head[i];
    /* the neck from its upper end down, in the source's picture */
    for (int k = 0; k < 3; k++) {
        ends[k] = s->pivot[k] + (k == 1 ? PLACE_NECK_TOP : 0);
        ends[3 + k] = s->pivot[k] + (k == 1 ? PLACE_NECK_BOTTOM : 0);
    }
    camera_project(end, NULL, source, 2, ends, 2);
    for (int k = 0; k < 2; k++)
        down[k] = end[2 + k] - end[k];
    /* a head that looks down sees it short */
    const float min = (PLACE_NECK_TOP - PLACE_NECK_BOTTOM) * CAMERA_FOCAL /
                        (2 * fmaxf(source[11], CAMERA_NEAR));
    const float square = fmaxf(down[0] * down[0] + down[1] * down[1],
                               min * min);
    for (int k = 0; k < 2; k++)
        v->neck[k] = (down[0] * map[k] + down[1] * map[2 + k]) / square;
    v->neck[2] = (down[0] * (map[4] + 1 - end[0]) +
                  down[1] * (map[5] + 1 - end[1])) / square;
}

void place_view_make(struct splat_place_view *v, const float source[12],
                     const float cam[12], const struct place_shoulders *s)
{
    float head[6];

    memset(v, 0, sizeof *v);
    place_map(head, source, cam);
    memcpy(v->A, head, sizeof v->A);
    memcpy(v->b, head + 4, sizeof v->b);
    for (int k = 0; k < 2; k++) {
        const float *axis = source + 4 * k;

        v->toward[k] = -(axis[0] * cam[8] + axis[1] * cam[9] +
                         axis[2] * cam[10]);
    }
    if (s)
        place_set_shoulders(v, head, source, cam, s);
}

void place_view_focal(struct splat_place_view *v, float focal)
{
    const float by = CAMERA_FOCAL / focal;

    for (int i = 0; i < 4; i++) {
        v->A[i] *= by;
        v->shoulders[i] *= by;
    }
    v->neck[0] *= by;
    v->neck[1] *= by;
}

PARALLEL(place_of_source_part, i, float *, uv, float *, seen,
         const float *, cam, const float *, mean, const float *, scale)
{
    const float *s = scale + 3 * i, *at = uv + 2 * i;
    float z;

    camera_project(uv + 2 * i, &z, cam, 1, mean + 3 * i, 1);
    const float r = PLACE_REACH * fmaxf(s[0], fmaxf(s[1], s[2])) *
                    CAMERA_FOCAL / (2 * z);

    if (!(z > CAMERA_NEAR && at[0] >= -r && at[0] <= 1 + r && at[1] >= -r &&
          at[1] <= 1 + r))
        seen[i] = 0;
}

void place_of_source(float *uv, float *seen, const float *mean,
                     const float *scale, const float cam[12], size_t N)
{
    parallel_each(place_of_source_part, N, 1, uv, seen, cam, mean, scale);
}
