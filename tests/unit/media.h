/* For tests of pictures and clips that other people's tools make: a command in
 * the test's folder, frames and pictures read by ours, and how far two are
 * apart. */
#ifndef SPID_TESTS_MEDIA_H
#define SPID_TESTS_MEDIA_H

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/framesource.h"
#include "formats/image.h"
#include "tests/check.h"
#include "tests/folder.h"

/* A shell command in the folder; whether it went well. */
__attribute__((format(printf, 1, 2))) static inline bool
media_run(const char *format, ...)
{
    char cmd[4096];
    int n = snprintf(cmd, sizeof cmd, "cd %s && { ", folder);
    va_list args;

    va_start(args, format);
    n += vsnprintf(cmd + n, sizeof cmd - (size_t)n, format, args);
    va_end(args);
    snprintf(cmd + n, sizeof cmd - (size_t)n, "; } </dev/null >log 2>&1");
    if (system(cmd) == 0)
        return true;
    snprintf(cmd, sizeof cmd, "cat %s/log", folder);
    return system(cmd) != 0 && false;
}

/* Whether all of these programs are there; says which is not. */
static inline bool media_have(const char *programs)
{
    return media_run(
        "for p in %s; do command -v $p >/dev/null || { case $p in "
        "convert) d=imagemagick ;; exiftool) d=libimage-exiftool-perl ;; "
        "jpgicc|tificc) d=liblcms2-utils ;; heif-enc) d=libheif-examples ;; "
        "*) d=$p ;; esac; echo \"no $p (apt: $d)\"; exit 1; }; done", programs);
}

/* A picture by our reader; width 0 where it fails, and the test with it. */
static inline struct image media_picture(const char *name)
{
    struct error err = {0};
    struct image im;

    if (image_read(&im, folder_at(name), &err))
        check_error(name, false, &err);
    return im;
}

/* Frame k of a clip, copied; width 0 where it fails, and the test with it. */
static inline struct image media_frame(const char *name, uint64_t k)
{
    const char *path = folder_at(name);
    struct error err = {0};
    struct framesource *s = framesource_open(&path, 1, NULL, &err);
    struct image im = {0};
    struct frame f;
    int rc = s ? 1 : -1;

    while (rc == 1 && !im.rgb && (rc = framesource_read(s, &f, &err)) == 1)
        if (f.index == k) {
            im.width = f.width;
            im.height = f.height;
            im.rgb = malloc(3 * f.width * f.height);
            if (im.rgb)
                memcpy(im.rgb, f.rgb, 3 * f.width * f.height);
        }
    framesource_close(s);
    if (!im.rgb)
        check_error(name, false, &err);
    return im;
}

/* The largest difference of two pictures, in levels; *mean of all values where
 * it is asked for.  Infinite where their sizes differ. */
static inline double media_apart(const struct image *a, const struct image *b,
                                 double *mean)
{
    const size_t n = 3 * a->width * a->height;
    double max = 0, sum = 0;

    if (mean)
        *mean = INFINITY;
    if (!a->rgb || !b->rgb || a->width != b->width || a->height != b->height)
        return INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double d = abs(a->rgb[i] - b->rgb[i]);

        max = fmax(max, d);
        sum += d;
    }
    if (mean)
        *mean = sum / (double)n;
    return max;
}

/* check() of how far two pictures are apart; both are released. */
static inline void media_check(const char *what, struct image a,
                               struct image b, double limit)
{
    check(what, media_apart(&a, &b, NULL), limit);
    image_release(&a);
    image_release(&b);
}

#endif
