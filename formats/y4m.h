/* YUV4MPEG2: the header line, and the colours.  Matrix BT.709 (or BT.601),
 * limited or full range. */
#ifndef SPID_FORMATS_Y4M_H
#define SPID_FORMATS_Y4M_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

enum y4m_chroma { Y4M_444, Y4M_422, Y4M_420, Y4M_MONO };

struct y4m {
    size_t width, height;
    int rate_num, rate_den;        /* F; 25:1 when absent */
    int aspect_num, aspect_den;    /* A; 0:0 when absent */
    enum y4m_chroma chroma;
    double site_x, site_y;         /* chroma sample 0 in luma pixels */
    bool full;                     /* XCOLORRANGE=FULL */
    bool bt601;                    /* not in the header: the caller's choice */
};

/* Parse a header line (without its newline).  EX_DATAERR names the field. */
int y4m_parse(struct y4m *y, const char *line, struct error *err);
/* Write the header line of Y4M_444 with newline; returns its length (below
 * 80). */
size_t y4m_header(char *line, size_t size, const struct y4m *y);
/* Bytes of one frame's planes. */
size_t y4m_frame_bytes(const struct y4m *y);

/* planes (Y, then Cb, then Cr) of Y4M_444 from rgb [H,W,3]. */
void y4m_from_rgb(uint8_t *planes, const uint8_t *rgb, const struct y4m *y);
/* rgb [H,W,3] from planes; chroma is interpolated linearly at its site. */
void y4m_to_rgb(uint8_t *rgb, const uint8_t *planes, const struct y4m *y);
/* The same from planes that lie apart, plane k's rows step[k] bytes from one to
 * the next, to rows of rgb that are `stride` bytes apart. */
typedef void y4m_rows_fn(uint8_t *rgb, size_t stride,
                         const uint8_t *const plane[3], const int step[3],
                         const struct y4m *y);
y4m_rows_fn y4m_rows_to_rgb;

#endif
