/* Laying pictures out in one large one. */
#include "lib/lab/data/contact_sheet.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

int contact_sheet_init(struct contact_sheet *s, size_t rows, size_t cols,
                       size_t side, struct error *err)
{
    s->rows = rows;
    s->cols = cols;
    s->side = side;
    s->rgb = calloc(rows * cols * side * side, 3);
    if (!s->rgb)
        return error_set(err, EX_OSERR, "out of memory (sheet of %zux%zu)",
                         rows * side, cols * side);
    return 0;
}

void contact_sheet_release(struct contact_sheet *s)
{
    free(s->rgb);
    s->rgb = NULL;
}

/* A value in [0,1] as a byte. */
static uint8_t contact_sheet_byte(float x)
{
    return (uint8_t)(x <= 0 ? 0 : x >= 1 ? 255 : x * 255 + 0.5f);
}

/* Pixel (y,x) of the picture in a row and column. */
static uint8_t *contact_sheet_pixel(struct contact_sheet *s, size_t row,
                                    size_t col, size_t y, size_t x)
{
    return s->rgb +
           3 * ((row * s->side + y) * s->cols * s->side + col * s->side + x);
}

void contact_sheet_picture(struct contact_sheet *s, size_t row, size_t col,
                           const float *rgb, const float *alpha)
{
    for (size_t y = 0; y < s->side; y++)
        for (size_t x = 0; x < s->side; x++) {
            size_t i = y * s->side + x;
            float rest = alpha ? 0.35f * (1 - alpha[i]) : 0;
            for (int c = 0; c < 3; c++)
                contact_sheet_pixel(s, row, col, y, x)[c] =
                    contact_sheet_byte(rgb[3 * i + (size_t)c] + rest);
        }
}

int contact_sheet_image(struct contact_sheet *s, size_t row, size_t col,
                        const struct image *im, struct error *err)
{
    const double w = (double)im->width, h = (double)im->height;
    uint8_t *cell = malloc(3 * s->side * s->side);

    if (!cell || crop_resize_u8(cell, s->side, im->rgb, im->width, im->height,
                                3 * im->width, 3,
                                (struct square){w / 2, h / 2, fmax(w, h)})) {
        free(cell);
        return error_set(err, EX_OSERR, "out of memory");
    }
    for (size_t y = 0; y < s->side; y++)
        memcpy(contact_sheet_pixel(s, row, col, y, 0), cell + 3 * s->side * y,
               3 * s->side);
    free(cell);
    return 0;
}

void contact_sheet_difference(struct contact_sheet *s, size_t row, size_t col,
                              const float *a, const float *b)
{
    for (size_t y = 0; y < s->side; y++)
        for (size_t x = 0; x < s->side; x++)
            for (size_t c = 0; c < 3; c++) {
                size_t i = 3 * (y * s->side + x) + c;
                contact_sheet_pixel(s, row, col, y, x)[c] =
                    contact_sheet_byte(4 * fabsf(a[i] - b[i]));
            }
}

void contact_sheet_points(struct contact_sheet *s, size_t row, size_t col,
                          const float (*xy)[2], struct square q,
                          enum contact_sheet_colour colour)
{
    static const uint8_t rgb[2][3] = {{60, 255, 60}, {255, 50, 50}};
    double scale = (double)s->side / q.size;

    for (size_t i = 0; i < 68; i++) {
        double x = (xy[i][0] - q.x) * scale + 0.5 * (double)s->side;
        double y = (xy[i][1] - q.y) * scale + 0.5 * (double)s->side;
        if (x >= 0 && y >= 0 && x < (double)s->side - 1 &&
            y < (double)s->side - 1)
            for (int k = 0; k < 4; k++)
                memcpy(contact_sheet_pixel(s, row, col,
                                           (size_t)y + (size_t)k / 2,
                                           (size_t)x + (size_t)k % 2),
                       rgb[colour], 3);
    }
}

int contact_sheet_save(struct contact_sheet *s, const char *path,
                       struct error *err)
{
    int rc = image_write_png(path, s->rgb, s->cols * s->side,
                             s->rows * s->side, 3, err);

    contact_sheet_release(s);
    return rc;
}
