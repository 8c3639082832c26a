/* What the data know of a frame: its motion and camera, where face and open
 * mouth lie in a picture of another size, and what lies behind the person. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/lab/data/data.h"

#define MOUTH_OPEN 0.025     /* lips count as open: gap over the face crop */

void data_truth(struct head_motion *m, float cam[12],
                const struct data_frame *f)
{
    *m = f->motion.pose;
    m->exp = f->motion.exp;
    motion_camera(cam, &f->motion);
}

void data_turn(struct data_frame *out, const struct data_frame *f,
               double angle)
{
    const float c = (float)cos(angle), s = (float)sin(angle);
    const float middle = 0.5f * (float)f->size;

    *out = *f;
    out->turn = f->turn + angle;
    for (int i = 0; i < 3; i++) {
        out->motion.R[i] = c * f->motion.R[i] - s * f->motion.R[3 + i];
        out->motion.R[3 + i] = s * f->motion.R[i] + c * f->motion.R[3 + i];
    }
    out->motion.light[0] = c * f->motion.light[0] - s * f->motion.light[1];
    out->motion.light[1] = s * f->motion.light[0] + c * f->motion.light[1];
    out->motion.t[0] = c * f->motion.t[0] - s * f->motion.t[1];
    out->motion.t[1] = s * f->motion.t[0] + c * f->motion.t[1];
    for (int i = 0; i < 68; i++) {
        float x = f->lmk[i][0] - middle, y = f->lmk[i][1] - middle;

        out->lmk[i][0] = middle + c * x - s * y;
        out->lmk[i][1] = middle + s * x + c * y;
    }
    out->crop = crop_from_landmarks(&out->lmk[0][0], 68);
}

/* lo to hi, in pixels, inside a picture of `image` pixels a side. */
static struct box truth_clip(const double lo[2], const double hi[2],
                             size_t image)
{
    size_t a[2], b[2];

    for (int i = 0; i < 2; i++) {
        a[i] = lo[i] < 0 ? 0 : lo[i] > (double)image ? image : (size_t)lo[i];
        b[i] = hi[i] < 0 ? 0 : hi[i] > (double)image ? image : (size_t)hi[i];
    }
    return (struct box){a[0], a[1], b[0], b[1]};
}

struct box data_face(const struct data_frame *f, size_t image)
{
    double k = (double)image / (double)f->size, half = 0.5 * f->crop.size * k;

    return truth_clip((double[2]){f->crop.x * k - half, f->crop.y * k - half},
                      (double[2]){f->crop.x * k + half, f->crop.y * k + half},
                      image);
}

struct box data_mouth(const struct data_frame *f, size_t image)
{
    enum { FIRST = 60, LAST = 67 };     /* inner lips */
    double k = (double)image / (double)f->size, lo[2], hi[2];
    const float *upper = f->lmk[HEAD_LIP_UPPER], *lower = f->lmk[HEAD_LIP_LOWER];
    double gap = hypot((double)(lower[0] - upper[0]),
                       (double)(lower[1] - upper[1]));

    if (!(gap > MOUTH_OPEN * f->crop.size))
        return (struct box){0};
    for (int i = 0; i < 2; i++) {
        lo[i] = hi[i] = (double)f->lmk[FIRST][i] * k;
        for (int j = FIRST + 1; j <= LAST; j++) {
            lo[i] = fmin(lo[i], (double)f->lmk[j][i] * k);
            hi[i] = fmax(hi[i], (double)f->lmk[j][i] * k);
        }
    }
    return truth_clip(lo, hi, image);
}

/* ---- as a source photograph --------------------------------------------- */

int data_source(struct person *p, const struct data_frame *f, size_t size,
                struct error *err)
{
    const size_t n = f->size * f->size;

    if (f->size != size || f->width != size || f->height != size)
        return error_set(err, EX_DATAERR, "pictures of %zux%zu (expected "
                         "%zux%zu, the model's size)", f->width, f->height,
                         size, size);
    *p = (struct person){.size = size, .rgb = malloc(3 * n),
                         .matte = malloc(n), .back = malloc(3 * n)};
    if (!p->rgb || !p->matte || !p->back) {
        person_release(p);
        return error_set(err, EX_OSERR, "no memory for the source picture");
    }
    for (size_t i = 0; i < n; i++) {
        const int m = p->matte[i] = f->rgba[4 * i + 3];

        memcpy(p->rgb + 3 * i, f->rgba + 4 * i, 3);
        memcpy(p->back + 3 * i, f->rgba + 4 * i, 3);
        for (size_t c = 0; f->alone && m < 255 && c < 3; c++) {
            const int back = 255 * (f->rgba[4 * i + c] - f->alone[3 * i + c]) /
                             (255 - m);

            p->back[3 * i + c] = (uint8_t)(back < 0 ? 0
                                           : back > 255 ? 255 : back);
        }
    }
    return 0;
}
