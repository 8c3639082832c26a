/* Cells of posed heads under one light. */
#include "lib/lab/head/head_sheet.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"
#include "lib/base/random.h"
#include "lib/base/preview.h"
#include "lib/head/arkit.h"
#include "lib/head/lbs.h"

/* What one picture shows. */
struct cell {
    float yaw, pitch;
    int person;               /* 0: the mean; else seed of random shape */
    float jaw, lid, gaze[2];  /* radians; lid 0..1; gaze down, left */
    int wire;
    int close;                /* the eyes, mouth, face: 1, 2, 3 */
};

static const struct cell cells[] = {
    { .yaw = 0 }, { .yaw = -40 }, { .yaw = -90 }, { .yaw = -30, .pitch = -30 },
    { .yaw = 150 }, { .wire = 1 }, { .close = 1 }, { .close = 2 },
    { .person = 1 }, { .person = 2 }, { .person = 3 }, { .person = 4 },
    { .person = 5 }, { .person = 6 }, { .person = 7 }, { .person = 8 },
    { .person = 9 }, { .person = 10 },
    { .person = 1, .yaw = -40 }, { .person = 2, .yaw = -40 },
    { .person = 3, .yaw = -90 }, { .person = 4, .yaw = -40 },
    { .person = 5, .yaw = -90 }, { .person = 6, .yaw = -40 },
    { .jaw = 0.12f }, { .jaw = 0.3f }, { .jaw = 0.3f, .yaw = -40 },
    { .jaw = 0.3f, .close = 2 }, { .lid = 0.5f, .close = 1 },
    { .lid = 1, .close = 1 }, { .lid = 1 }, { .lid = 1, .yaw = -40 },
    { .gaze = { 0, 0.4f }, .close = 1 }, { .gaze = { 0, -0.4f }, .close = 1 },
    { .gaze = { 0.4f, 0 }, .close = 1 }, { .gaze = { -0.4f, 0 }, .close = 1 },
};
enum {
    ACROSS = 8, POSES = sizeof cells / sizeof *cells,
    CELLS = POSES + ARKIT_COUNT, DOWN = (CELLS + ACROSS - 1) / ACROSS
};

/* Eyes with iris and pupil, lips redder; linear albedo. */
static void sheet_colors(float *c, const struct head *h)
{
    for (size_t v = 0; v < h->V; v++) {
        static const float skin[3] = { 0.60f, 0.47f, 0.40f };
        static const float lip[3] = { 0.50f, 0.30f, 0.27f };
        static const float white[3] = { 0.80f, 0.79f, 0.77f };
        static const float iris[3] = { 0.16f, 0.20f, 0.22f };
        static const float pupil[3] = { 0.01f, 0.01f, 0.01f };
        const float *p = h->v_template + v * 3, *use = skin;
        int region = h->region ? h->region[v] : REGION_SKIN;

        if (region == REGION_LIPS)
            use = lip;
        if (region == REGION_EYEBALL) {
            const float *e = h->joint_template + 3 * (p[0] > 0
                ? JOINT_EYE_LEFT : JOINT_EYE_RIGHT);
            float x = p[0] - e[0], y = p[1] - e[1], z = p[2] - e[2];
            float off = (x * x + y * y) / (h->scale * h->scale);

            use = z < 0 || off > 0.0061f * 0.0061f ? white
                : off > 0.0022f * 0.0022f ? iris : pupil;
        }
        memcpy(c + v * 3, use, 3 * sizeof *c);
    }
}

/* The mean head, or a random person, doing what the cell says. */
static int sheet_pose_cell(float *verts, const struct head *h,
                           const struct cell *c, int expression,
                           struct error *err)
{
    float beta[HEAD_MAX_EXP] = { 0 }, exp[HEAD_MAX_EXP] = { 0 };
    float w[ARKIT_COUNT] = { 0 };
    size_t n = h->nshape < HEAD_MAX_EXP ? h->nshape : HEAD_MAX_EXP;
    struct identity id;
    struct head_motion m = { .exp = exp };
    struct random r;

    random_init(&r, (uint64_t)c->person, "sheet person");
    for (size_t k = 0; c->person && k < n; k++)
        beta[k] = (float)random_normal(&r);
    if (expression >= 0 && head_has_arkit(h)) {
        w[expression] = 1;
        if (expression == ARKIT_MOUTH_CLOSE)    /* it closes an open jaw */
            w[ARKIT_JAW_OPENED] = 1;
        arkit_to_motion(exp, (int)h->nexp, m.jaw, m.lid, m.eye, w);
    } else if (expression >= 0 && (size_t)expression < h->nexp) {
        exp[expression] = 1;
    } else {
        m.jaw[0] = c->jaw;
        m.lid[0] = m.lid[1] = c->lid;
        m.eye[0] = m.eye[3] = c->gaze[0];
        m.eye[1] = m.eye[4] = c->gaze[1];
    }
    if (head_fold(&id, h, beta, n, err))
        return -1;
    head_pose(verts, &id, &m);
    identity_release(&id);
    return 0;
}

/* Poses from a table, then each expression by itself, in rows. */
static int sheet_draw_cells(uint8_t *rgb, float *verts, const float *color,
                            const struct head *h, size_t size,
                            struct error *err)
{
    static const struct cell plain = { .close = 3 };
    struct preview_mesh mesh = { verts, h->f, color, h->V, h->F };

    for (size_t i = 0; i < CELLS; i++) {
        const struct cell *c = i < POSES ? &cells[i] : &plain;
        int expression = i < POSES ? -1 : (int)(i - POSES);
        struct preview_view view = { c->yaw, c->pitch,
            { 0, -0.012f * h->scale, 0 }, 0.325f * h->scale, c->wire };

        if (c->close) {
            static const float y[] = { 0, 0.025f, -0.045f, -0.01f };

            view.centre[1] = y[c->close] * h->scale;
            view.centre[2] = 0.08f * h->scale;
            view.height = (c->close == 3 ? 0.19f : 0.11f) * h->scale;
        }
        if (sheet_pose_cell(verts, h, c, expression, err) ||
            preview_draw(rgb, ACROSS * size, i % ACROSS * size,
                         i / ACROSS * size, size, size, &mesh, &view, err))
            return -1;
    }
    return 0;
}

int head_sheet(const char *path, const struct head *h, size_t size,
               struct error *err)
{
    uint8_t *rgb = calloc((size_t)ACROSS * DOWN * size * size, 3);
    float *verts = malloc(h->V * 3 * sizeof *verts);
    float *color = malloc(h->V * 3 * sizeof *color);
    int rc = -1;

    if (!rgb || !verts || !color) {
        error_set(err, EX_OSERR, "out of memory for a sheet of %zu pixels",
                  size);
        goto out;
    }
    sheet_colors(color, h);
    if (sheet_draw_cells(rgb, verts, color, h, size, err) == 0)
        rc = image_write_png(path, rgb, ACROSS * size, DOWN * size, 3,
                             err);
out:
    free(rgb);
    free(verts);
    free(color);
    return rc;
}
