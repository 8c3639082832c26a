/* A light by name, by angles or of a panorama (target_light.h). */
#include "lib/avatar/target_light.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "formats/panorama.h"
#include "lib/base/harmonics.h"

#define RADIANS 0.0174532925f   /* in a degree */

/* Azimuth 0 is at the camera, 90 to the picture's right; elevation 90 above. */
static int target_light_set_angles(struct target_light *t, const float v[3],
                                   int n, struct error *err)
{
    const float azimuth = v[0] * RADIANS, elevation = v[1] * RADIANS;
    const float strength = n == 3 ? v[2] : 1;

    if (n < 2 || !(fabsf(v[0]) <= 180) || !(fabsf(v[1]) <= 90) ||
        !(strength >= 0 && strength <= 1))
        return error_set(err, EX_USAGE, "not a light (expected AZIMUTH,"
                         "ELEVATION[,STRENGTH]: -180 to 180, -90 to 90, 0 to "
                         "1)");
    t->from = LIGHT_GIVEN;
    t->source_strength = n == 2;
    t->l[0] = strength * cosf(elevation) * sinf(azimuth);
    t->l[1] = -strength * sinf(elevation);
    t->l[2] = -strength * cosf(elevation) * cosf(azimuth);
    return 0;
}

int target_light_parse(const char *value, void *dest, struct error *err)
{
    struct target_light *t = dest;
    struct panorama p;
    float v[3];
    char rest;

    *t = (struct target_light){0};
    if (strcmp(value, "source") == 0 || strcmp(value, "driver") == 0) {
        t->from = *value == 's' ? LIGHT_SOURCE : LIGHT_DRIVER;
        return 0;
    }
    const int n = sscanf(value, "%f,%f,%f%c", v, v + 1, v + 2, &rest);

    if (strspn(value, "+-.,0123456789") == strlen(value))
        return target_light_set_angles(t, v, n > 3 ? 0 : n, err);
    if (panorama_read(&p, value, err))
        return error_prefix(err, "not source, driver or AZIMUTH,ELEVATION"
                            "[,STRENGTH], and not a panorama");
    t->from = LIGHT_GIVEN;
    light_of_panorama(t->l, p.rgb, (int)p.width, (int)p.height);
    panorama_release(&p);
    return 0;
}

int target_light_apply(struct baked *b, const struct target_light *t,
                       const struct motion *driver, struct error *err)
{
    const float *l = b->light;
    float strength = 1, facing;

    if (t->from == LIGHT_KEPT)
        return 0;
    baked_keep_light(b);
    if (t->from == LIGHT_SOURCE)
        return 0;
    if (!baked_is_lit(b))
        return error_set(err, EX_DATAERR, "--light: the avatar does not know "
                         "the light on its photograph (expected one of a "
                         "model with light.slope)");
    if (t->from == LIGHT_DRIVER && !(driver && driver->lit))
        return error_set(err, EX_DATAERR, "--light=driver: the driver does not "
                         "say its light (expected a clip, or the motions of "
                         "spid-motion --light)");
    if (t->source_strength)
        strength = sqrtf(l[0] * l[0] + l[1] * l[1] + l[2] * l[2]);
    facing = 1 - b->lamp[2] / 2;
    for (int k = 0; k < 3; k++)
        b->lamp[k] = t->from == LIGHT_DRIVER ? driver->light[k]
                                             : strength * t->l[k];
    b->lamp[3] = facing / (1 - b->lamp[2] / 2);
    return 0;
}
