/* A light by name, by angles or of a panorama (target_light.h). */
#include "lib/avatar/target_light.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "formats/panorama.h"
#include "lib/base/harmonics.h"
#include "lib/base/vec3.h"

/* ",#RRGGBB", or nothing: white.  Light is the square of sRGB (lib/splat/relight.h).
 * false: something else, or black. */
static bool target_light_set_color(struct target_light *t, const char *text)
{
    unsigned rgb[3] = {1, 1, 1};
    float luminance;
    char rest;

    if (*text && (strlen(text) != 8 ||
                  sscanf(text, ",#%2x%2x%2x%c", rgb, rgb + 1, rgb + 2,
                         &rest) != 3))
        return false;
    for (int c = 0; c < 3; c++)
        t->color[c] = (float)(rgb[c] * rgb[c]);
    luminance = light_luminance(t->color);
    for (int c = 0; c < 3; c++)
        t->color[c] /= luminance;
    return luminance > 0;
}

/* AZIMUTH,ELEVATION[,STRENGTH][,#RRGGBB].  Azimuth 0 is at the camera, 90 to the
 * picture's right; elevation 90 above. */
static int target_light_set_angles(struct target_light *t, const char *value,
                                   struct error *err)
{
    float v[3] = {0};
    int read = 0;
    const int n = sscanf(value, "%f,%f%n,%f%n", v, v + 1, &read, v + 2, &read);
    const float azimuth = v[0] * DEGREE_F, elevation = v[1] * DEGREE_F;
    const float strength = n == 3 ? v[2] : 1;

    if (n < 2 || !target_light_set_color(t, value + read) ||
        !(fabsf(v[0]) <= 180) || !(fabsf(v[1]) <= 90) ||
        !(strength >= 0 && strength <= 1))
        return error_set(err, EX_USAGE, "not a light (expected AZIMUTH,"
                         "ELEVATION[,STRENGTH][,#RRGGBB]: -180 to 180, -90 to "
                         "90, 0 to 1, not black)");
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

    *t = (struct target_light){.color = {1, 1, 1}};
    if (strcmp(value, "source") == 0 || strcmp(value, "driver") == 0) {
        t->from = *value == 's' ? LIGHT_SOURCE : LIGHT_DRIVER;
        return 0;
    }
    if (strspn(value, "+-.,0123456789") == strcspn(value, "#"))
        return target_light_set_angles(t, value, err);
    if (panorama_read(&p, value, err))
        return error_prefix(err, "not source, driver or AZIMUTH,ELEVATION"
                            "[,STRENGTH][,#RRGGBB], and not a panorama");
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
    for (int c = 0; c < 3; c++)
        b->lamp[3 + c] = t->color[c] * facing / (1 - b->lamp[2] / 2);
    return 0;
}
