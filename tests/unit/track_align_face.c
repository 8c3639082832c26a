/* Alignment of an expression on pictures that are exact: an ellipsoid with
 * waves on it, which two directions or one and a lid stretch, seen by a known
 * camera. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/track/align_face.h"
#include "tests/check.h"
#include "tests/unit/sphere_head.h"

#define N ALIGN_SIDE
#define FOCAL 1500.0
#define DISTANCE 11.0
#define STRETCH 0.1             /* of a direction, per unit */

static const double axis[3] = {0.4, 0.55, 0.45};
static const struct align_camera camera = {
    {1, 0, 0, 0, -1, 0, 0, 0, -1}, {0, 0, DISTANCE}, FOCAL,
    {N / 2, N / 2}, {2, 2}, {N - 2, N - 2}};

/* Direction number of `count` in dirs stretches the head along an axis. */
static void face_stretch(float *dirs, size_t count, size_t number, size_t along,
                         const struct head *h)
{
    const size_t line = 3 * HEAD_BLOCK;

    for (size_t v = 0; v < h->V; v++) {
        const size_t block = v / HEAD_BLOCK * count + number;

        dirs[block * line + along * HEAD_BLOCK + v % HEAD_BLOCK] =
            (float)STRETCH * h->v_template[3 * v + along];
    }
}

/* Component 0 stretches the head along the first axis; component 1 along the
 * second one, or, if `lid`, the left lid does; the others do nothing. */
static void face_directions(struct head *h, bool lid)
{
    const size_t block = 3 * HEAD_BLOCK * sizeof(float);

    memset(h->exp_dirs, 0, h->blocks * h->nexp * block);
    memset(h->lids, 0, h->blocks * 2 * block);
    face_stretch(h->exp_dirs, h->nexp, 0, 0, h);
    if (lid)
        face_stretch(h->lids, 2, 0, 1, h);
    else
        face_stretch(h->exp_dirs, h->nexp, 1, 1, h);
}

/* rgb (2N,2N,3) = the ellipsoid with expression e, its light changed. */
static void face_render(float *rgb, const float e[2], double gain, double bias)
{
    const double stretch[3] = {1 + STRETCH * e[0], 1 + STRETCH * e[1], 1};

    for (size_t i = 0; i < 4 * N * N; i++) {
        const double u = ((double)(i % (2 * N)) + 0.5) / 2 - N / 2.0;
        const double v = ((double)(i / (2 * N)) + 0.5) / 2 - N / 2.0;
        const double d[3] = {u / FOCAL, -v / FOCAL, -1};
        const double o[3] = {0, 0, DISTANCE};
        double a = 0, b = 0, c = -1, level = 0.3;

        for (int k = 0; k < 3; k++) {
            const double r = axis[k] * stretch[k];

            a += d[k] / r * d[k] / r;
            b += d[k] / r * o[k] / r;
            c += o[k] / r * o[k] / r;
        }
        if (b * b > a * c) {
            const double s = (-b - sqrt(b * b - a * c)) / a;
            const double x = (o[0] + s * d[0]) / stretch[0];
            const double y = (o[1] + s * d[1]) / stretch[1];

            level = 0.5 + 0.12 * sin(14 * x + 1) + 0.1 * sin(11 * y + 9 * x) +
                    0.1 * sin(13 * y - 12 * x) + 0.08 * sin(23 * x + 2);
        }
        for (size_t k = 0; k < 3; k++)
            rgb[3 * i + k] = (float)(gain * level + bias);
    }
}

/* What is left of the error of direction k after alignment; `lid`: the second
 * one is the left lid's. */
static double face_error(size_t k, bool lid, const struct identity *id)
{
    static const float rest[2] = {0};
    const float truth[2] = {0.5f, lid ? 0.4f : -0.4f};
    const float given[2] = {0.35f, 0.7f * truth[1]};
    static _Alignas(64) align_pixel picture[N * N];
    float *rgb = malloc(12 * N * N * sizeof *rgb);
    float *work = malloc(2 * N * N * sizeof *work), *shown;
    struct align_face f;
    struct motion m = {0};
    struct error err = {0};

    REQUIRE(align_face_init(&f, id, &err) == 0 && rgb && work, "%s", err.text);
    CHECK(f.codes == 2, "%zu directions are sought, of 2", f.codes);
    shown = malloc(2 * f.room * sizeof *shown);
    face_render(rgb, rest, 1, 0);
    CPU_PICK(align_kernels)->picture(picture, work, rgb);
    align_face_show(shown, &f, &m, picture, &camera);
    face_render(rgb, truth, 0.97, 0.02);
    CPU_PICK(align_kernels)->picture(picture, work, rgb);
    float *const sought[2] = {m.exp, lid ? m.pose.lid : m.exp + 1};
    for (int i = 0; i < 2; i++)
        *sought[i] = given[i];
    align_face_fit(&f, &m, shown, picture, &camera, 1, 0);
    free(shown);
    free(rgb);
    free(work);
    align_face_release(&f);
    CHECK(m.exp[2] == 0 && m.exp[3] == 0, "what does not move was changed");
    CHECK(m.pose.lid[1] == 0, "the other lid was changed");
    return fabs((double)*sought[k] - truth[k]) /
           fabs((double)given[k] - truth[k]);
}

/* What the points of a keyframe with these lids weigh together. */
static double face_weight(float lid, const struct identity *id)
{
    static _Alignas(64) align_pixel picture[N * N];
    const struct motion m = {.pose.lid = {0, lid}};
    struct align_face f;
    struct error err = {0};
    double sum = 0;

    REQUIRE(align_face_init(&f, id, &err) == 0, "%s", err.text);
    float *shown = malloc(2 * f.room * sizeof *shown);
    REQUIRE(shown, "out of memory");
    align_face_show(shown, &f, &m, picture, &camera);
    for (size_t i = 0; i < f.room; i++)
        sum += (double)shown[f.room + i];
    free(shown);
    align_face_release(&f);
    return sum;
}

/* Landmarks of the lips: middles at places that the second direction parts,
 * corners at places that the first one does. */
static void face_lips(struct head *h)
{
    for (size_t l = 60; l < 68; l++) {
        const float x = l == 60 ? -0.3f : l == 64 ? 0.3f : 0;
        const float y = x != 0 ? 0 : l < 64 ? 0.3f : -0.3f;
        double min = INFINITY;

        for (size_t i = 0; i < h->F; i++) {
            const float *p = h->v_template + 3 * h->f[3 * i];
            const double far = hypot(p[1] - y, p[0] - x) + (p[2] < 0);

            if (far < min) {
                min = far;
                h->landmark_faces[l] = (int32_t)i;
            }
        }
        h->landmark_bary[3 * l] = 1;
        h->landmark_bary[3 * l + 1] = h->landmark_bary[3 * l + 2] = 0;
    }
    h->has_landmarks = 1;
}

int main(void)
{
    const float beta[2] = {0};
    struct head h;
    struct identity id;
    struct align_face none;
    struct error err = {0};

    sphere_head(&h, 48, 64);
    face_directions(&h, false);
    REQUIRE(head_fold(&id, &h, beta, 2, &err) == 0, "%s", err.text);
    REQUIRE(align_face_init(&none, &id, &err) == 0, "%s", err.text);
    check_that("a head without regions: nothing is sought", none.codes == 0);
    align_face_release(&none);
    h.region = malloc(h.V * sizeof *h.region);
    for (size_t v = 0; v < h.V; v++)
        h.region[v] = REGION_FACE;
    h.nlip_inner = 0;
    check("across: what is left of an error", face_error(0, false, &id), 0.2);
    check("upwards", face_error(1, false, &id), 0.2);
    face_directions(&h, true);
    identity_release(&id);
    REQUIRE(head_fold(&id, &h, beta, 2, &err) == 0, "%s", err.text);
    check("across, beside a lid", face_error(0, true, &id), 0.2);
    check_range("a lid, which E_m says better, is held to it",
                face_error(1, true, &id), 0.12, 0.2);
    face_directions(&h, false);
    for (size_t v = 0; v < h.V; v++)
        h.region[v] = REGION_EYELID;
    check_range("half shut eyes of a keyframe: weight of their lids",
                face_weight(0.5f, &id) / face_weight(0, &id), 0.3, 0.5);
    check("shut ones", face_weight(0.7f, &id), 0);
    for (size_t v = 0; v < h.V; v++)
        h.region[v] = REGION_FACE;
    face_lips(&h);
    check_range("what widens the mouth is held a little",
                face_error(0, false, &id), 0.05, 0.3);
    check_range("what opens it is held", face_error(1, false, &id), 0.7, 1);
    identity_release(&id);
    head_release(&h);
    return check_status();
}
