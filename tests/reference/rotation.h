/* Rotations by their definition. */
#ifndef SPID_TESTS_REFERENCE_ROTATION_H
#define SPID_TESTS_REFERENCE_ROTATION_H

/* R (3,3) of q = w,x,y,z of any length but 0. */
void rotation_quat_d(double R[9], const double q[4]);

#endif
