/* What a set of synthetic people is like, as numbers. */
#ifndef SPID_LAB_PEOPLE_STATISTICS_H
#define SPID_LAB_PEOPLE_STATISTICS_H

#include <stdio.h>

#include "lib/head/head.h"
#include "lib/lab/people/synth.h"

/* Mean, spread, smallest and largest value of every parameter over the people
 * and frames of opt, as a table on out.  -1 when a write failed. */
int synth_statistics(FILE *out, const struct head *head,
                     const struct synth_options *opt);

/* Colour and edge figures of a picture rgb (n,n,3): mean and deviation of each
 * channel (0..255), mean gradient, and the share of gradients in eight bins of
 * doubling size from 1. */
struct picture_figures {
    double mean[3], deviation[3], edge, bin[8];
};
/* Of rgb (h,w,3). */
void picture_figures(struct picture_figures *f, const unsigned char *rgb,
                     int w, int h);

/* The same for the first frame of up to 64 people of opt, their mean. */
int synth_figures(struct picture_figures *f, const struct head *head,
                  const struct synth_options *opt, struct error *err);
/* One line of figures; without f the line of headings. */
void picture_print(FILE *out, const char *name,
                   const struct picture_figures *f);

#endif
