/* Inside the module: what its table has of pictures; those of HEIF, AVIF and
 * WebP by their own libraries, which tell of profiles and code points; animations
 * of WebP. */
#ifndef SPID_FORMATS_MEDIA_STILL_H
#define SPID_FORMATS_MEDIA_STILL_H

#include <stdint.h>

#include "formats/door.h"
#include "formats/module.h"

/* image_read and panorama_read, by names that the program has not. */
int media_image_read(struct image *im, const char *path, struct error *err);
int media_panorama_read(struct panorama *p, const char *path,
                        struct error *err);
/* exr_write with the sentence of formats/mark.h, or NULL. */
int media_exr_write(const char *path, const float *pixel, size_t width,
                    size_t height, int channels, const char *const *names,
                    const char *mark, struct error *err);
/* As image_read, for a file of these kinds; 1: it is another. */
int still_read(struct image *im, const char *path, struct error *err);
/* A whole file; the caller frees.  NULL and *err. */
uint8_t *still_load(const char *path, size_t *bytes, struct error *err);
/* n bytes in memory, of which the caller knows the kind. */
int heif_read(struct image *im, const uint8_t *data, size_t n,
              const char *name, struct error *err);
/* The same; of an animation the first frame. */
int webp_read(struct image *im, const uint8_t *data, size_t n,
              const char *name, struct error *err);
/* An animation as a video; NULL as video_open. */
struct video_reader *webp_open(const char *path, struct error *err);

#endif
