/* libFuzzer target: frames on a pipe, Y4M, PPM, PGM, PAM and PNG. */
#include <stdlib.h>
#include <string.h>

#include "formats/png.h"
#include "formats/pnm.h"
#include "formats/y4m.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define MAX_PIXELS 65536

static void take_y4m(FILE *fp)
{
    struct error err;
    struct y4m y;
    char line[512];
    uint8_t *planes, *rgb;
    size_t bytes;

    if (!fgets(line, sizeof line, fp))
        return;
    line[strcspn(line, "\n")] = 0;
    if (y4m_parse(&y, line, &err) != 0 || y.width * y.height > MAX_PIXELS)
        return;
    bytes = y4m_frame_bytes(&y);
    planes = calloc(1, bytes);
    rgb = malloc(3 * y.width * y.height);
    if (planes && rgb && fread(planes, 1, bytes, fp) <= bytes)
        y4m_to_rgb(rgb, planes, &y);
    free(planes);
    free(rgb);
}

static void take_pnm(FILE *fp)
{
    struct error err;
    uint8_t *rgb = NULL;
    size_t room = 0, w, h;

    while (pnm_read(fp, &rgb, &room, &w, &h, MAX_PIXELS, &err) == 1)
        ;
    free(rgb);
}

static void take_png(FILE *fp)
{
    struct error err;
    struct image im;

    while (png_read_next(&im, fp, MAX_PIXELS, &err) == 0)
        image_release(&im);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    FILE *fp = size ? fmemopen((void *)data, size, "rb") : NULL;

    if (!fp)
        return 0;
    if (data[0] == 'Y')
        take_y4m(fp);
    else if (data[0] == 'P')
        take_pnm(fp);
    else
        take_png(fp);
    fclose(fp);
    return 0;
}
