/* Contact sheets: pictures in rows and columns, with points on them. */
#ifndef SPID_LAB_DATA_CONTACT_SHEET_H
#define SPID_LAB_DATA_CONTACT_SHEET_H

#include <stddef.h>
#include <stdint.h>

#include "formats/image.h"
#include "lib/base/error.h"
#include "lib/base/crop.h"

struct contact_sheet {
    size_t rows, cols, side;
    uint8_t *rgb;           /* (rows*side, cols*side, 3) */
};

/* rows x cols cells of side x side pixels, black. */
int contact_sheet_init(struct contact_sheet *s, size_t rows, size_t cols,
                       size_t side, struct error *err);
/* Free what it holds. */
void contact_sheet_release(struct contact_sheet *s);

/* Put rgb (side,side,3), values clamped to [0,1], into a place; with alpha
 * (side,side) it is composed over grey. */
void contact_sheet_picture(struct contact_sheet *s, size_t row, size_t col,
                           const float *rgb, const float *alpha);
/* Put a picture of any size into a place, as large as fits. */
int contact_sheet_image(struct contact_sheet *s, size_t row, size_t col,
                        const struct image *im, struct error *err);
/* The difference |a - b|, four times enlarged. */
void contact_sheet_difference(struct contact_sheet *s, size_t row, size_t col,
                              const float *a, const float *b);
enum contact_sheet_colour { CONTACT_SHEET_TRUE, CONTACT_SHEET_FOUND };

/* The 68 landmarks in the pixels of the picture that square q was cut from: true
 * ones green, found ones red. */
void contact_sheet_points(struct contact_sheet *s, size_t row, size_t col,
                          const float (*xy)[2], struct square q,
                          enum contact_sheet_colour colour);
/* Write the sheet as PNG and release it. */
int contact_sheet_save(struct contact_sheet *s, const char *path,
                       struct error *err);

#endif
