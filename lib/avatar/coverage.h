/* What of the source picture the mesh covers: the coverage map C, the depth
 * of the surface, and which vertices the camera sees. */
#ifndef SPID_AVATAR_COVERAGE_H
#define SPID_AVATAR_COVERAGE_H

#include <stddef.h>
#include <stdint.h>

/* C (n,n) in [0,1]: the fraction of each cell of the plane that the mesh
 * covers, counted on 8 x 8 points per cell, then a Gaussian of one cell.
 *   verts (V,3), faces (F,3), cam (3,4)
 *   scratch  coverage_scratch(n) bytes */
void coverage_map(float *C, const float *verts, const int32_t *faces, size_t F,
                  const float cam[12], size_t n, void *scratch);
/* Bytes of scratch that maps of n x n need. */
size_t coverage_scratch(size_t n);
/* The fractions before the Gaussian. */
void coverage_fraction(float *C, const float *verts, const int32_t *faces,
                       size_t F, const float cam[12], size_t n, void *scratch);
/* out = x (n,n) convolved with a normalised Gaussian of sigma cells, zero
 * outside; tmp holds n*n floats. */
void coverage_blur(float *out, const float *x, size_t n, float sigma,
                   float *tmp);

/* A cell that the mesh covers less of lies on its outline or beside it. */
#define COVERAGE_WHOLE 0.97f

/* out (n,n): how many cells lie between a cell and the mesh in the same row; 0
 * where that has none.  coverage (n,n): fraction that the mesh covers. */
void coverage_distance(float *out, const float *coverage, size_t n);

enum { COVERAGE_CHANNELS = 3 };     /* at most */

/* z (n,n): camera depth of the nearest surface at each cell's centre,
 * +infinity where there is none; value (n,n,channels): attribute (V,channels)
 * there, 0 where there is none. */
void coverage_depth(float *z, float *value, size_t channels,
                    const float *verts, const float *attribute,
                    const int32_t *faces, size_t F, const float cam[12],
                    size_t n);

/* near (n,n): the least of z (n,n) up to r cells to each side; tmp holds n*n
 * floats. */
void coverage_near(float *near, const float *z, size_t n, size_t r, float *tmp);

/* seen (N) in [0,1] of points x (N,3): 0 behind the surface in z (n,n) by
 * more than slack, 1 in front of it or on it, the mean of the four cells
 * around; 0 outside the picture. */
void coverage_seen(float *seen, const float *x, size_t N, const float *z,
                   size_t n, const float cam[12], float slack);

#endif
