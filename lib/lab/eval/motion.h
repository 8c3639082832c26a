/* Distances between two motions: landmarks, rotations, scalar curves. */
#ifndef SPID_LAB_EVAL_MOTION_H
#define SPID_LAB_EVAL_MOTION_H

#include <stddef.h>

#define METRIC_LANDMARKS 68 /* 0-16 jaw line, 17-67 brows, nose, eyes, mouth */
#define METRIC_JAW 17

/* Mean Euclidean distances between two sets of 68 landmarks, in the unit of
 * the landmarks (pixels).  akd is over all 68, aed over the 51 inner, apd
 * over the 17 of the jaw line: akd = (51 aed + 17 apd) / 68. */
struct metric_points {
    double akd, aed, apd;
};

/* Of two sets of 68 landmarks in the same unit. */
void metric_points(struct metric_points *out, const float a[68][2],
                   const float b[68][2]);

/* Distance between the outer corners of the eyes (landmarks 36 and 45): what
 * "percent of the eye distance" divides by. */
double metric_eye_distance(const float a[68][2]);

/* The angle in degrees of the rotation between two rotation matrices. */
double metric_rotation_degrees(const float a[9], const float b[9]);

/* Yaw, pitch, roll in degrees of the head that a camera rotation R shows:
 * R = diag(1,-1,-1) Rz(roll) Rx(pitch) Ry(yaw), zero for a frontal face. */
void metric_euler_degrees(double out[3], const float R[9]);

/* Pearson's correlation of two curves; NaN when one of them is constant or
 * n < 2. */
double metric_correlation(const double *a, const double *b, size_t n);

/* Angle of an axis-angle vector's x component: how far the jaw is open. */
double metric_jaw_open(const float jaw[3]);

#endif
