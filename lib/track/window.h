/* The portrait window: the square of a picture that shows a head with its hair
 * and shoulders, whichever way it faces. */
#ifndef SPID_TRACK_WINDOW_H
#define SPID_TRACK_WINDOW_H

#include <stdbool.h>

#include "lib/base/crop.h"
#include "lib/head/motion.h"

/* Distance of a head from the camera where the window is about it, head units:
 * 18 cm from its origin to each side.  So far were the neutral photographs of
 * 60 people of training (10.8, spid-motion) while windows were 2.2 times as wide
 * as the detector's face; 12: tests/bench/README.md, "The portrait
 * window". */
#define WINDOW_DISTANCE 11.0

/* *window, of S pixels, becomes the one about the head that m shows in it (whole:
 * on whole pixels of the picture); m's crop and translation become the new
 * one's. */
void window_about_head(struct square *window, struct motion *m, double S,
                       bool whole);

#endif
