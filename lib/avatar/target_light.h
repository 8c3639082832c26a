/* The light that an avatar is shown in (--light): what the photograph shows of
 * a surface is multiplied by gaussian_light of this light on it now over that of
 * the photograph's own (lib/splat/relight.h), which is also what shades a head
 * anew that turns under its own.  Pictures are exposed as the photograph was: the
 * mean light on surfaces that face the camera, 1 - l_z / 2, stays what it is. */
#ifndef SPID_AVATAR_TARGET_LIGHT_H
#define SPID_AVATAR_TARGET_LIGHT_H

#include <stdbool.h>

#include "lib/avatar/baked.h"
#include "lib/base/error.h"
#include "lib/head/motion.h"

struct target_light {
    enum {
        LIGHT_KEPT,             /* whatever the avatar is shown in */
        LIGHT_SOURCE,           /* the photograph's own */
        LIGHT_DRIVER,           /* on the driver's first face */
        LIGHT_GIVEN
    } from;
    float l[3];                 /* given: camera frame, */
    bool source_strength;       /* or its direction; |l| is the source's */
    float color[3];             /* linear, of luminance 1 */
};

/* source, driver, AZIMUTH,ELEVATION[,STRENGTH][,#RRGGBB] or a panorama's path into dest, a
 * struct target_light.  EX_USAGE: numbers out of range, or not as many; else as
 * panorama_read has it. */
int target_light_parse(const char *value, void *dest, struct error *err);

/* Show b in it; driver (NULL: none) is the driver's first motion.  EX_DATAERR when
 * it is not known how light fell on the source, or on the driver. */
int target_light_apply(struct baked *b, const struct target_light *t,
                       const struct motion *driver, struct error *err);

#endif
