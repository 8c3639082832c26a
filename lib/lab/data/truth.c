/* What the data know of a frame: its motion and camera, and where face and
 * open mouth lie in a picture of another size. */
#include <math.h>
#include <string.h>

#include "lib/lab/data/data.h"
#include "lib/base/camera.h"

#define MOUTH_OPEN 0.025     /* lips count as open: gap over the face crop */

void data_truth(struct head_motion *m, float cam[12],
                const struct data_frame *f)
{
    memset(m, 0, sizeof *m);
    m->exp = f->motion.exp;
    memcpy(m->jaw, f->motion.jaw, sizeof m->jaw);
    memcpy(m->eye, f->motion.eye, sizeof m->eye);
    memcpy(m->lid, f->motion.lid, sizeof m->lid);
    camera_make(cam, f->motion.rot, f->motion.trans);
}

void data_turn(struct data_frame *out, const struct data_frame *f,
               double angle)
{
    const float c = (float)cos(angle), s = (float)sin(angle);
    const float middle = 0.5f * (float)f->size;

    *out = *f;
    out->turn = f->turn + angle;
    for (int i = 0; i < 3; i++) {
        out->motion.rot[i] = c * f->motion.rot[i] - s * f->motion.rot[3 + i];
        out->motion.rot[3 + i] = s * f->motion.rot[i] +
                                 c * f->motion.rot[3 + i];
    }
    out->motion.trans[0] = c * f->motion.trans[0] - s * f->motion.trans[1];
    out->motion.trans[1] = s * f->motion.trans[0] + c * f->motion.trans[1];
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
    enum { FIRST = 60, LAST = 67, UPPER = 62, LOWER = 66 };  /* inner lips */
    double k = (double)image / (double)f->size, lo[2], hi[2];
    double gap = hypot((double)(f->lmk[LOWER][0] - f->lmk[UPPER][0]),
                       (double)(f->lmk[LOWER][1] - f->lmk[UPPER][1]));

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
