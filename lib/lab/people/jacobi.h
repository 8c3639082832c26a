/* Eigenvectors of small symmetric matrices. */
#ifndef SPID_LAB_PEOPLE_JACOBI_H
#define SPID_LAB_PEOPLE_JACOBI_H

#include <stddef.h>

/* One sweep of Jacobi's rotations over the symmetric a (n,n), towards a
 * diagonal of its eigenvalues; the columns of v (n,n), which starts as the
 * identity, become its eigenvectors.  Returns the largest entry off the
 * diagonal as the sweep met them: repeat until that is small. */
double jacobi_sweep(double *a, double *v, size_t n);

#endif
