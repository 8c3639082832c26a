/* Buffers of one picture, and what fills them (canvas.h). */
#include "lib/animate/canvas.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/photo/place.h"
#include "lib/splat/relight.h"
#include "lib/splat/splat.h"

static int canvas_too_large(const struct canvas *c, struct error *err)
{
    return error_set(err, EX_OSERR, "no memory for %zu x %zu pixels", c->size,
                     c->size);
}

int canvas_init(struct canvas *c, size_t size, size_t channels, bool half,
                bool depth, struct error *err)
{
    const size_t pixels = size * size;

    *c = (struct canvas){.size = size, .channels = channels};
    if (half)                   /* 64-byte lines of 32 numbers */
        c->half = aligned_alloc(64, (pixels * channels + 31) / 32 * 64);
    else
        c->image = malloc(pixels * channels * sizeof *c->image);
    c->alpha = malloc(pixels * sizeof *c->alpha);
    c->depth = depth ? malloc(pixels * sizeof *c->depth) : NULL;
    return (c->image || c->half) && c->alpha && (!depth || c->depth)
               ? 0 : canvas_too_large(c, err);
}

void canvas_release(struct canvas *c)
{
    free(c->image);
    free(c->half);
    free(c->alpha);
    free(c->depth);
    free(c->place);
    free(c->photo);
    free(c->gain);
    memset(c, 0, sizeof *c);
}

/* Memory for what is looked up if `photo`, and for places if asked for, unless
 * it is there already. */
static int canvas_reserve(struct canvas *c, bool photo, struct error *err)
{
    const size_t pixels = c->size * c->size;

    if (c->places && !c->place)
        c->place = malloc(SPLAT_PLACE_CHANNELS * pixels * sizeof *c->place);
    if (photo && !c->photo)
        c->photo = malloc(TEXTURE_PHOTO * pixels * sizeof *c->photo);
    if (c->lit && !c->gain)
        c->gain = malloc(relight_side(c->size) * relight_side(c->size) *
                         sizeof *c->gain);
    return (!c->places || c->place) && (!photo || c->photo) &&
                   (!c->lit || c->gain)
               ? 0 : canvas_too_large(c, err);
}

int canvas_draw(struct canvas *c, struct splat *s,
                const struct splat_camera *cam, const struct texture *t,
                bool beside, struct error *err)
{
    struct splat_pictures to = {.image = c->image, .half = c->half,
                                .alpha = c->alpha, .depth = c->depth};

    if (t) {
        if (canvas_reserve(c, beside, err))
            return -1;
        texture_shader_init(&c->shader, t, &c->view, c->size,
                            beside ? c->photo : NULL, c->channels);
        to.place = c->place;
        to.shade = texture_shade;
        to.ctx = &c->shader;
    }
    if (splat_draw(s, &to, cam, &c->view, NULL, err))
        return -1;
    if (t && c->lit)
        splat_relight(c->gain, c->tint, s, c->light);
    if (t && c->lit && !beside)
        relight_apply(c->image, c->channels, c->alpha, c->gain, c->tint,
                      c->size, c->size, c->size);
    return 0;
}
