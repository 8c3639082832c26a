#include "lib/head/sculpt_sheet.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"
#include "lib/base/random.h"
#include "lib/geom/preview.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"

enum { ACROSS = 5, DOWN = 8, CELLS = ACROSS * DOWN };

/* What one picture shows. */
struct cell {
    float yaw, pitch;
    int person;               /* 0: the mean; else seed of random shape */
    float jaw, lid, gaze[2];  /* radians; lid 0..1; gaze down, left */
    const char *exp[2];       /* names of directions */
    int wire;
};

static const struct cell cells[CELLS] = {
    { .yaw = 0 }, { .yaw = -40 }, { .yaw = -90 }, { .yaw = -30, .pitch = -30 },
    { .wire = 1 },
    { .person = 1 }, { .person = 2 }, { .person = 3 }, { .person = 4 },
    { .person = 5 },
    { .person = 6 }, { .person = 7 }, { .person = 8 }, { .person = 9 },
    { .person = 10 },
    { .person = 1, .yaw = -40 }, { .person = 2, .yaw = -40 },
    { .person = 3, .yaw = -90 }, { .person = 4, .yaw = -40 },
    { .person = 5, .yaw = -90 },
    { .jaw = 0.12f }, { .jaw = 0.3f }, { .jaw = 0.3f, .yaw = -40 },
    { .lid = 0.5f }, { .lid = 1 },
    { .lid = 1, .yaw = -40 }, { .gaze = { 0, 0.4f } },
    { .gaze = { 0.35f, 0 } }, { .gaze = { -0.3f, -0.3f } },
    { .exp = { "smile left", "smile right" } },
    { .exp = { "smile left", "smile right" }, .yaw = -40 },
    { .exp = { "frown" } }, { .exp = { "pucker" } },
    { .exp = { "funnel" } }, { .exp = { "brow down" } },
    { .exp = { "brow up left", "brow inner up" } },
    { .exp = { "sneer left", "upper lip raise" } },
    { .exp = { "cheek puff", "nostril flare" } }, { .exp = { "lip press" } },
    { .exp = { "chin raise", "squint left" } },
};

/* Eyes with iris and pupil, lips redder; linear albedo. */
static void colors(float *c, const struct sculpt *s)
{
    for (size_t v = 0; v < s->nv; v++) {
        static const float skin[3] = { 0.60f, 0.47f, 0.40f };
        static const float lip[3] = { 0.50f, 0.30f, 0.27f };
        static const float white[3] = { 0.80f, 0.79f, 0.77f };
        static const float iris[3] = { 0.16f, 0.20f, 0.22f };
        static const float pupil[3] = { 0.01f, 0.01f, 0.01f };
        const float *p = s->v_template + v * 3, *use = skin;
        if (s->region[v] == REGION_LIPS)
            use = lip;
        if (s->region[v] == REGION_EYEBALL)
            use = p[2] > 0.0797f ? pupil : p[2] > 0.0783f ? iris : white;
        memcpy(c + v * 3, use, 3 * sizeof *c);
    }
}

static void set_expression(float *exp, const char *name)
{
    for (size_t k = 0; name && k < SCULPT_EXPRESSIONS; k++)
        if (!strcmp(sculpt_expression_name(k), name))
            exp[k] = 1;
}

static int pose_cell(float *verts, const struct head *h, const struct cell *c,
                     struct error *err)
{
    float beta[SCULPT_SHAPES] = { 0 }, exp[SCULPT_EXPRESSIONS] = { 0 };
    struct identity id;
    struct head_motion m = { .exp = exp };
    struct random r;
    random_init(&r, (uint64_t)c->person, "sheet person");
    for (size_t k = 0; c->person && k < SCULPT_SHAPES; k++)
        beta[k] = (float)random_normal(&r);
    set_expression(exp, c->exp[0]);
    set_expression(exp, c->exp[1]);
    m.jaw[0] = c->jaw;
    m.lid[0] = m.lid[1] = c->lid;
    m.eye[0] = m.eye[3] = c->gaze[0];
    m.eye[1] = m.eye[4] = c->gaze[1];
    if (head_fold(&id, h, beta, SCULPT_SHAPES, err))
        return -1;
    head_pose(verts, &id, &m);
    identity_release(&id);
    return 0;
}

static int draw_cells(uint8_t *rgb, float *verts, const float *color,
                      const struct head *h, size_t size, struct error *err)
{
    struct preview_mesh mesh = { verts, h->f, color, h->V, h->F };
    for (size_t i = 0; i < CELLS; i++) {
        const struct cell *c = &cells[i];
        struct preview_view view = { c->yaw, c->pitch,
            { 0, -0.012f * h->scale, 0 }, 0.325f * h->scale, c->wire };
        if (pose_cell(verts, h, c, err) ||
            preview_draw(rgb, ACROSS * size, i % ACROSS * size,
                         i / ACROSS * size, size, size, &mesh, &view, err))
            return -1;
    }
    return 0;
}

int sculpt_sheet(const char *path, const struct sculpt *s, size_t size,
                 struct error *err)
{
    struct head_arrays a;
    struct head h = { 0 };
    uint8_t *rgb = malloc(CELLS * size * size * 3);
    float *verts = malloc(s->nv * 3 * sizeof *verts);
    float *color = malloc(s->nv * 3 * sizeof *color);
    int rc = -1;
    sculpt_arrays(&a, s);
    if (!rgb || !verts || !color) {
        error_set(err, EX_OSERR, "out of memory for a sheet of %zu pixels",
                  size);
        goto out;
    }
    colors(color, s);
    if (head_init(&h, &a, err) == 0 &&
        draw_cells(rgb, verts, color, &h, size, err) == 0)
        rc = image_write_png(path, rgb, ACROSS * size, DOWN * size, 3, err);
    head_release(&h);
out:
    free(rgb);
    free(verts);
    free(color);
    return rc;
}
