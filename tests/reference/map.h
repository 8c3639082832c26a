/* Networks in double as plain loops over maps, and their gradients by
 * differences. */
#ifndef SPID_TESTS_REFERENCE_MAP_H
#define SPID_TESTS_REFERENCE_MAP_H

#include <stdbool.h>
#include <stddef.h>

struct map {
    size_t h, w, C;
    double *v;                  /* (h,w,C); the caller frees */
};

/* Of zeros; ends the program where there is no memory. */
struct map map_make(size_t h, size_t w, size_t C);
/* Of those numbers. */
struct map map_of(const float *x, size_t h, size_t w, size_t C);

/* Convolution by w (out,C,kernel,kernel) and b (out) or NULL, with pad pixels of
 * zeros around. */
struct map map_conv(const struct map *x, const float *w, const float *b,
                    size_t out, size_t kernel, size_t stride, size_t pad);
void map_relu(struct map *x);
/* Largest of 3 x 3 pixels, every second one; partly filled windows count where
 * `partial`. */
struct map map_max_pool(const struct map *x, bool partial);
/* Channels `at` on of to <- x. */
void map_put(struct map *to, size_t at, const struct map *x);

double map_dot(const struct map *x, const float *probe);
/* Greatest difference of x from the truth over the truth's greatest value. */
double map_error(const float *x, const struct map *truth);

/* How far gradient d of f is from f's difference along `way`, over the lengths of
 * both; infinite where d is nothing. */
double map_gradient_error(const float *d, struct map *x, const float *way,
                          double (*f)(const struct map *x, void *context),
                          void *context);

#endif
