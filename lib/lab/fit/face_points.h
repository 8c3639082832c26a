/* The labels' landmarks as points of our head: on the skin by the scans'
 * vertices that they mean, and two pupils on the eyeballs. */
#ifndef SPID_LAB_FIT_FACE_POINTS_H
#define SPID_LAB_FIT_FACE_POINTS_H

#include "lib/base/error.h"
#include "lib/lab/people/landmark_sets.h"
#include "lib/head/arkit.h"
#include "lib/head/head.h"
#include "lib/lab/head/scan.h"

#define FACE_SHAPES SCAN_IDENTITIES     /* shape coefficients that are fitted */
#define FACE_POSES 27                   /* pose directions: jaw, two eyes */

/* Directions in head units, each of LANDMARK_FACE points. */
struct face_points {
    double (*rest)[3];          /* (468,3) */
    double (*shape)[3];         /* (FACE_SHAPES,468,3) */
    double (*exp)[3];           /* (ARKIT_COUNT,468,3), 0 what joints do */
    double (*pose)[3];          /* (FACE_POSES,468,3) of R - I */
    double (*lid)[3];           /* (2,468,3) left, right, closed */
    double (*lid_shape)[3];     /* (2,FACE_SHAPES,468,3) */
    double weight[LANDMARK_FACE];       /* how far each is trusted; mean 1 */
    struct face_eye {
        double joint[3], pupil[3];      /* pupil: from the joint, at rest */
        double joint_shape[FACE_SHAPES][3], pupil_shape[FACE_SHAPES][3];
    } eye[2];
};

/* For a head of the scans (lib/head/arkit.h): a landmark is the point of our
 * skin nearest to its vertex that looks the same way. */
int face_points_init(struct face_points *p, const struct head *head,
                     const struct scan *scan, const struct landmark_map *m,
                     struct error *err);
void face_points_release(struct face_points *p);    /* may be zeroed */

/* A person's: identity folded in. */
struct face_own {
    double at[LANDMARK_FACE][3];
    double lid[2][LANDMARK_FACE][3];
    double joint[2][3], pupil[2][3];
};
/* beta: standard deviations. */
void face_points_fold(struct face_own *o, const struct face_points *p,
                      const double beta[FACE_SHAPES]);

/* x = where the points lie under ARKit's weights w, head frame. */
void face_points_pose(double x[LANDMARK_FACE][3], const struct face_points *p,
                      const struct face_own *o, const double w[ARKIT_COUNT]);
/* d (468,3) = derivative of face_points_pose by w_k.  Exact, for the joints
 * too. */
void face_points_slope(double d[LANDMARK_FACE][3],
                       const struct face_points *p, const struct face_own *o,
                       const double w[ARKIT_COUNT], int k);
/* Where a pupil lies when its eye has turned by pitch about +x and yaw about
 * +y (axis times angle, radians). */
void face_pupil(double x[3], const struct face_own *o, int side, double pitch,
                double yaw);

#endif
