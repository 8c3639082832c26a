/* The inner lips' colours, and the lips' shade as a veil of Gaussians. */
#include "lib/avatar/lip_lining.h"

#include <math.h>
#include <string.h>

#define MUCOSA 0.3f     /* of the inner lips' colour is anyone's, and */
#define DIM 0.14f       /* so much of the light is lost between them, */
#define DIM_UP 0.16f    /* less where they face upwards */
#define VEIL 0.06f      /* opacity of one of the veil's Gaussians, */
#define VEIL_LOW 0.02f  /* of the lower lip's, for light comes from above, */
#define VEIL_MM 1.8f    /* and their standard deviation */
#define SHUT_MM 0.5f    /* lips so little open are closed, */
#define OPEN_MM 2.0f    /* so far they are open */

static const float lip_lining_mucosa[3] = {0.76f, 0.42f, 0.42f};
static const float lip_lining_dark[3] = {0.12f, 0.045f, 0.045f};

void lip_lining_paint(float *rgb, const float *seam, const float *normals,
                      const float white[3], size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const float light = 1 - seam[k] * (DIM - DIM_UP * normals[3 * k + 1]);

        for (int c = 0; c < 3; c++) {
            float *own = rgb + 3 * k + c;
            const float red = white[c] * lip_lining_mucosa[c];

            *own = light * (*own + MUCOSA * seam[k] * (red - *own));
        }
    }
}

float lip_lining_closed(const struct source_mesh *mesh)
{
    struct head_mouth lips;

    head_mouth(&lips, mesh->head, mesh->posed);
    return 1 - branch_ramp(lips.gap * 1e3f / mesh->head->scale, SHUT_MM,
                           OPEN_MM);
}

void lip_lining_shade(struct branch_set *out, const float *verts,
                      const struct source_mesh *mesh, const float white[3])
{
    const float closed = lip_lining_closed(mesh);
    const float size = VEIL_MM * 1e-3f * mesh->head->scale;
    float middle[3];

    head_lip_centroid(middle, mesh->head, mesh->posed);
    for (size_t k = 0; k < out->n; k++) {
        float *color = out->color + k * out->channels;

        if (!(mesh->weights->lining[k] > 0))
            continue;
        memset(color, 0, out->channels * sizeof *color);
        for (int c = 0; c < 3; c++) {
            color[c] = white[c] * lip_lining_dark[c];
            out->scale[3 * k + c] = size;
        }
        out->opacity[k] = closed * (verts[3 * k + 1] > middle[1]
                                    ? VEIL : VEIL_LOW);
    }
}

/* They are constants. */
void lip_lining_shade_backward(struct branch_set *dout,
                               const struct source_mesh *mesh)
{
    for (size_t k = 0; k < dout->n; k++) {
        if (!(mesh->weights->lining[k] > 0))
            continue;
        memset(dout->color + k * dout->channels, 0,
               dout->channels * sizeof *dout->color);
        memset(dout->scale + 3 * k, 0, 3 * sizeof *dout->scale);
        dout->opacity[k] = 0;
    }
}
