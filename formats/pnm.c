/* PAM, PPM and PGM pictures, one after the other, binary, 8 or 16 bits. */
#include "formats/pnm.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"

struct header {
    size_t width, height, depth, maxval;
};

/* The next number of a P5 or P6 header, comments skipped; 0 on failure. */
static size_t pnm_header_number(FILE *fp)
{
    size_t n = 0;
    int c = getc(fp), digits = 0;

    while (c == '#' || isspace(c)) {
        if (c == '#')
            while (c != '\n' && c != EOF)
                c = getc(fp);
        c = getc(fp);
    }
    while (isdigit(c) && digits++ < 7) {
        n = 10 * n + (size_t)(c - '0');
        c = getc(fp);
    }
    return isspace(c) ? n : 0;
}

/* The lines up to ENDHDR. */
static int pnm_read_pam(FILE *fp, struct header *h)
{
    char line[256];

    while (fgets(line, sizeof line, fp)) {
        char key[16];
        unsigned long v;

        if (strncmp(line, "ENDHDR", 6) == 0)
            return 0;
        if (sscanf(line, "%15s %7lu", key, &v) != 2)
            continue;
        if (strcmp(key, "WIDTH") == 0)
            h->width = v;
        else if (strcmp(key, "HEIGHT") == 0)
            h->height = v;
        else if (strcmp(key, "DEPTH") == 0)
            h->depth = v;
        else if (strcmp(key, "MAXVAL") == 0)
            h->maxval = v;
    }
    return -1;
}

/* 1: filled; 0: end of file; -1. */
static int pnm_read_header(FILE *fp, struct header *h, size_t max,
                           struct error *err)
{
    int p = getc(fp), k;

    while (isspace(p))                 /* some writers end with a newline */
        p = getc(fp);
    if (p == EOF)
        return 0;
    k = getc(fp);
    memset(h, 0, sizeof *h);
    if (p == 'P' && (k == '5' || k == '6')) {
        h->depth = k == '6' ? 3 : 1;
        h->width = pnm_header_number(fp);
        h->height = pnm_header_number(fp);
        h->maxval = pnm_header_number(fp);
    } else if (p != 'P' || k != '7' || pnm_read_pam(fp, h) != 0) {
        return error_set(err, EX_DATAERR, "not a PPM, PGM or PAM picture "
                         "(expected P5, P6 or P7)");
    }
    if (!h->width || !h->height || h->width > IMAGE_MAX_SIDE
        || h->height > IMAGE_MAX_SIDE
        || h->width * h->height > max)
        return error_set(err, EX_DATAERR, "picture of %zu x %zu pixels "
                         "(expected 1 to %d a side and at most %zu in all)",
                         h->width, h->height, IMAGE_MAX_SIDE,
                         max);
    if (h->maxval < 1 || h->maxval > 65535 || h->depth < 1 || h->depth > 4)
        return error_set(err, EX_DATAERR, "picture with depth %zu and maximal"
                         " value %zu (expected 1 to 4 and 1 to 65535)",
                         h->depth, h->maxval);
    return 1;
}

/* A sample scaled to 8 bits. */
static uint8_t pnm_pixel_sample(const uint8_t *p, const struct header *h)
{
    size_t v = h->maxval > 255 ? (size_t)p[0] << 8 | p[1] : p[0];

    if (h->maxval == 255)
        return (uint8_t)v;
    v = v > h->maxval ? h->maxval : v;
    return (uint8_t)((v * 255 + h->maxval / 2) / h->maxval);
}

int pnm_read(FILE *fp, uint8_t **rgb, size_t *room, size_t *width,
             size_t *height, size_t max, struct error *err)
{
    struct header h;
    uint8_t *line, *out;
    size_t bytes, row;
    int rc = pnm_read_header(fp, &h, max, err);

    if (rc <= 0)
        return rc;
    bytes = 3 * h.width * h.height;
    if (bytes > *room) {
        free(*rgb);
        *rgb = malloc(bytes);
        *room = *rgb ? bytes : 0;
    }
    row = h.width * h.depth * (h.maxval > 255 ? 2 : 1);
    line = malloc(row);
    if (!*rgb || !line) {
        free(line);
        return error_set(err, EX_OSERR, "out of memory");
    }
    out = *rgb;
    for (size_t y = 0; y < h.height && rc == 1; y++) {
        const size_t step = row / h.width, one = step / h.depth;

        if (fread(line, 1, row, fp) != row)
            rc = error_set(err, EX_DATAERR, "picture cut short in row %zu of"
                           " %zu", y, h.height);
        for (size_t x = 0; x < h.width && rc == 1; x++, out += 3)
            for (size_t c = 0; c < 3; c++)
                out[c] = pnm_pixel_sample(line + x * step
                                          + (h.depth < 3 ? 0 : c * one), &h);
    }
    free(line);
    *width = h.width;
    *height = h.height;
    return rc;
}

int pnm_write(FILE *fp, const uint8_t *pixel, size_t W, size_t H,
              size_t channels)
{
    fprintf(fp, "P7\nWIDTH %zu\nHEIGHT %zu\nDEPTH %zu\nMAXVAL 255\nTUPLTYPE "
            "%s\nENDHDR\n", W, H, channels,
            channels == 4 ? "RGB_ALPHA" : "RGB");
    return fwrite(pixel, channels, W * H, fp) == W * H ? 0 : -1;
}
