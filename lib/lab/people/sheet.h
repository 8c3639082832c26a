/* Contact sheets: what the people look like at a glance. */
#ifndef SPID_LAB_PEOPLE_SHEET_H
#define SPID_LAB_PEOPLE_SHEET_H

#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/lab/people/synth.h"

#define SHEET_COLUMNS 8
#define SHEET_ROWS 13           /* 8 of people, 3 of expressions, 2 of lights */

/* rgb (SHEET_ROWS * size, SHEET_COLUMNS * size, 3): 64 people of opt; the
 * first of them with 24 expressions, and under 12 lights. */
int synth_sheet(uint8_t *rgb, const struct head *head,
                const struct synth_options *opt, struct error *err);

#endif
