/* The inner lips' colours, and the lips' shade as a veil of Gaussians. */
#include "lib/avatar/lip_lining.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/vec3.h"

#define VEIL 0.1f      /* opacity of one of the veil's Gaussians, */
#define VEIL_LOW 0.03f  /* of the lower lip's, for light comes from above, */
#define VEIL_MM 2.6f    /* and their standard deviation */
#define SHUT_MM 0.5f    /* lips so little open are closed, */
#define OPEN_MM 2.0f    /* so far they are open */

/* Light comes from above: the light network's l_y is from 0.49 to 0.77 on six
 * photographs of validation.  Over about that range teeth lose what they may lose
 * at most, 0.28 of the light (56eaeb5). */
#define ABOVE 0.5f
#define OVERHEAD 0.95f  /* of the light is lost for l_y beyond it, but no more
                         * than at */
#define OVERHEAD_MAX 0.3f
#define TEETH_OFF 0.035f        /* teeth differ so little from white, in shares
                                 * of red, green and blue, */
#define LIPS_OFF 0.065f /* lips and skin at least so much; */
#define TEETH_DARK 0.45f        /* and teeth are so bright at least, over
                                 * white */
#define TEETH_LIT 0.6f

/* How far each matters: tests/bench/README.md, "Light on rims of lips". */
#define LINE_MM 5       /* lips meet so near to where the mesh's do: half a lip's
                         * height */
#define LINE_STEPS 4    /* a millimetre */
#define LINE_DARKER 0.1f        /* than in the middle a row that far away must be */
#define MIDDLE_MM 11    /* so near to the middle: half way to the corners */

#define LIP_RINGS 4     /* of the mesh from the inner lips on, */
#define RIM_RINGS 1     /* about teeth: gums, and lines between them */

static const float lip_lining_dark[3] = {0.24f, 0.1f, 0.09f};

void lip_lining_bend(float to[3], const float n[3], float seam)
{
    const float size = length3(n);

    memcpy(to, n, 3 * sizeof *to);
    to[2] += seam * size;
    const float by = size / (length3(to) + 1e-9f);
    for (int c = 0; c < 3; c++)
        to[c] *= by;
}

void lip_lining_paint(float *rgb, const float *seam, const float *normals,
                      const float white[3], size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const float *to = normals + 3 * k;
        const float sky = 0.5f * (1 + to[2] / (length3(to) + 1e-9f));

        for (int c = 0; c < 3; c++) {
            float *own = rgb + 3 * k + c;
            const float share = fminf(*own / fmaxf(white[c], 1e-3f), 1);
            const float lips = share * share * (1 - sky);

            *own *= 1 + seam[k] * (sqrtf(sky / (1 - lips + 1e-9f)) - 1);
        }
    }
}

float lip_lining_share(const float l[3])
{
    return 1 - OVERHEAD * fminf(fmaxf(l[1] - ABOVE, 0), OVERHEAD_MAX);
}

/* How far the photograph shows teeth at vertex k, by its colour. */
static float lip_lining_tooth(const float rgb[3], const float white[3])
{
    const float all = white[0] + white[1] + white[2];
    const float sum = rgb[0] + rgb[1] + rgb[2] + 1e-3f;
    float off = 0;

    for (int c = 0; c < 3; c++)
        off += fabsf(rgb[c] / sum - white[c] / all);
    return (1 - branch_ramp(off, TEETH_OFF, LIPS_OFF)) *
           branch_ramp(sum / all, TEETH_DARK, TEETH_LIT);
}

/* One ring further: on (V+E) becomes at each vertex what it is at most around,
 * where may (V) lets it; through midpoints, which may not be less. */
static void lip_lining_grow(float *on, const float *may, bool through,
                            const struct densify *d, float *tmp)
{
    memcpy(tmp, on, d->V * sizeof *tmp);
    for (size_t e = 0; e < 2 * d->E; e++) {
        const size_t i = (size_t)d->edge[e], j = (size_t)d->edge[e ^ 1];
        const float way = through ? may[d->V + e / 2] : 1;

        if (may[i] > 0)         /* few do */
            tmp[i] = fmaxf(tmp[i], fminf(on[j], fminf(may[i], way)));
    }
    memcpy(on, tmp, d->V * sizeof *tmp);
}

void lip_lining_on_teeth(float *on, const float *pixel,
                         const struct source_mesh *mesh, const float white[3],
                         const struct densify *d, float *tmp)
{
    const float open = 1 - lip_lining_closed(mesh);
    const float *lips = mesh->weights->lips, *seam = mesh->weights->seam;
    float *tooth = tmp + d->V;

    for (size_t k = 0; k < d->V + d->E; k++)
        tooth[k] = open * lips[k] > 0 ? open * lips[k] *
                                        lip_lining_tooth(pixel + 4 * k, white)
                                      : 0;
    for (size_t v = 0; v < d->V; v++)
        on[v] = tooth[v] * seam[v];
    for (int ring = 0; ring < LIP_RINGS; ring++)
        lip_lining_grow(on, tooth, true, d, tmp);
    for (int ring = 0; ring < RIM_RINGS; ring++)
        lip_lining_grow(on, lips, false, d, tmp);
    densify_midpoints(on + d->V, on, d, 1);
}

float lip_lining_closed(const struct source_mesh *mesh)
{
    struct head_mouth lips;

    head_mouth(&lips, mesh->head, mesh->posed);
    return 1 - branch_ramp(lips.gap * 1e3f / mesh->head->scale, SHUT_MM,
                           OPEN_MM);
}

float lip_lining_rise(const struct source_picture *picture,
                      const struct source_mesh *mesh)
{
    enum { N = 2 * LINE_MM * LINE_STEPS + 1 };
    const struct head *h = mesh->head;
    const float mm = 1e-3f * h->scale, step = mm / LINE_STEPS;
    float middle[3], at[3 * N], place[2 * N], rgba[4 * N], light[N] = {0};
    int line = N / 2;

    head_centroid(middle, h->lip_inner, h->nlip_inner, mesh->posed);
    for (size_t i = 0; i < h->nlip_inner; i++) {
        const float *v = mesh->posed + 3 * h->lip_inner[i];

        if (fabsf(v[0] - middle[0]) > MIDDLE_MM * mm)
            continue;
        for (int k = 0; k < N; k++) {
            memcpy(at + 3 * k, v, 3 * sizeof *at);
            at[3 * k + 1] += (float)(k - N / 2) * step;
        }
        source_mesh_project(place, at, N, mesh->cam);
        source_picture_sample(rgba, picture, place, N);
        for (int k = 0; k < N; k++)
            light[k] += rgba[4 * k] + rgba[4 * k + 1] + rgba[4 * k + 2];
    }
    for (int k = 0; k < N; k++) {
        const float off = 2 * (float)k / (N - 1) - 1;

        light[k] *= 1 + LINE_DARKER * off * off;
    }
    for (int k = 0; k < N; k++)
        if (light[k] < light[line])
            line = k;
    return lip_lining_closed(mesh) * (float)(line - N / 2) * step;
}

void lip_lining_shade(struct branch_set *out, const float *verts,
                      const struct source_mesh *mesh, const float white[3])
{
    const struct head *h = mesh->head;
    const float open = 1 - lip_lining_closed(mesh);
    const float size = VEIL_MM * 1e-3f * h->scale;
    float middle[3];

    head_centroid(middle, h->lip_inner, h->nlip_inner, mesh->posed);
    for (size_t k = 0; k < out->n; k++) {
        float *color = out->color + k * out->channels;

        if (!(mesh->weights->lining[k] > 0))
            continue;
        memset(color, 0, out->channels * sizeof *color);
        for (int c = 0; c < 3; c++) {
            color[c] = white[c] * lip_lining_dark[c];
            out->scale[3 * k + c] = size;
        }
        out->opacity[k] = verts[3 * k + 1] > middle[1] ? VEIL : VEIL_LOW;
        out->seen[k] = open;
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
