/* The comparisons that the C library's sort asks for. */
#include "lib/base/sort.h"

#include <stdlib.h>

#define SORT_ORDER(name, type)                                                \
    static int name(const void *a, const void *b)                             \
    {                                                                         \
        const type x = *(const type *)a, y = *(const type *)b;                \
                                                                              \
        return (x > y) - (x < y);                                             \
    }
SORT_ORDER(sort_order_floats, float)
SORT_ORDER(sort_order_doubles, double)
SORT_ORDER(sort_order_keys, uint64_t)

void sort_floats(float *x, size_t n)
{
    qsort(x, n, sizeof *x, sort_order_floats);
}

void sort_doubles(double *x, size_t n)
{
    qsort(x, n, sizeof *x, sort_order_doubles);
}

void sort_keys(uint64_t *x, size_t n)
{
    qsort(x, n, sizeof *x, sort_order_keys);
}
