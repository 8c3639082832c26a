/* One pass of E_m over a crop: what it sees, what it says, and where that leads
 * (pass.h). */
#include "lib/track/pass.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/cpu.h"
#include "lib/net/motion_code.h"

#define FIRST_PASSES 4         /* network runs for the first crop, and so many */
#define LAST_PASSES 12         /* while each moves it by less than DRIFTS of the */
#define DRIFTS 0.9             /* one before, until it moves by SETTLED of its */
#define SETTLED 5e-4           /* side: a quarter of a pixel from where any start
                                * leads */
#define HOPELESS 0.05F         /* E_m less sure than this of the second crop or a
                                * later one settles on no face: none of 301 */
#define JUMP 0.5               /* of the crop's side: heads move less a frame */
#define GROWTH 1.6             /* factor of its side, likewise */
#define BEHIND (-0.2)          /* cosine of a head's turn: its back is shown */
#define VISIBLE 0.4            /* least share of the crop in the picture */

void track_cut(float *out, struct track *t, struct square crop)
{
    mipmap_sample(out, CROP_NET, &t->picture,
                  square_out_of(crop, t->window, t->opt.size));
}

int track_crop(void *track, float *rgb, struct square crop, struct error *err)
{
    (void)err;
    track_cut(rgb, track, crop);
    return 0;
}

/* ---- what the network says -------------------------------------------- */

void track_decode(struct motion *m, const float out[MOTION_OUT],
                  struct square crop, double size)
{
    memset(m, 0, sizeof *m);
    motion_code_decode(m->R, m->t, &m->pose, out, crop, size);
    memcpy(m->exp, out + MOTION_EXP, (MOTION_JAW - MOTION_EXP) * sizeof *out);
    m->pose.exp = NULL;         /* a copy would point at the original's */
    m->crop[0] = (float)crop.x;
    m->crop[1] = (float)crop.y;
    m->crop[2] = (float)crop.size;
}

void track_project(float *uv, struct track *t, const struct motion *m)
{
    float lmk[3 * HEAD_LANDMARKS], cam[12];
    struct head_motion pose = m->pose;

    pose.exp = m->exp;
    landmarks_pose(lmk, &t->landmarks, &pose);
    camera_make(cam, m->R, m->t);
    camera_project(uv, NULL, cam, (float)t->opt.size, lmk, HEAD_LANDMARKS);
}

void track_encode(struct track *t, struct track_result *r, struct square crop,
                  bool follows)
{
    float *out = t->said;
    double t0 = cpu_seconds(), t1, t2;

    track_cut(t->input, t, crop);
    t1 = cpu_seconds();
    (follows ? motion_tta_follow : motion_tta_forward)(out, &t->tta, t->input);
    r->confidence = motion_tta_confidence(&t->tta);
    t2 = cpu_seconds();
    track_decode(&r->motion, out, crop, t->opt.size);
    r->crop_s += t1 - t0;
    r->network_s += t2 - t1;
    r->heads_s += cpu_seconds() - t2;
}

/* ---- where it leads ----------------------------------------------------- */

struct square track_next_crop(struct track *t, const struct motion *m)
{
    float uv[2 * HEAD_LANDMARKS];

    track_project(uv, t, m);
    return crop_from_landmarks(uv, HEAD_LANDMARKS);
}

double track_visible(const struct track *t, struct square crop)
{
    const struct mipmap_level *f = t->picture.level;
    struct square q = square_out_of(crop, t->window, t->opt.size);
    const double half = q.size / 2;
    double w = fmin(q.x + half, (double)f->W) - fmax(q.x - half, 0);
    double h = fmin(q.y + half, (double)f->H) - fmax(q.y - half, 0);

    return w > 0 && h > 0 ? w * h / (q.size * q.size) : 0;
}

const char *track_implausible(const struct track *t, const struct motion *m,
                              struct square next, struct square used)
{
    double move = hypot(next.x - used.x, next.y - used.y);

    if (!isfinite(next.x) || !isfinite(next.y) || !isfinite(next.size)
        || !(m->t[2] > 1))
        return "no sensible position";
    if (move > JUMP * used.size)
        return "it jumped";
    if (next.size > GROWTH * used.size || next.size < used.size / GROWTH)
        return "its size jumped";
    if (-m->R[8] < BEHIND)
        return "it turned away";
    if (track_visible(t, next) < VISIBLE)
        return "it left the picture";
    return NULL;
}

void track_settle(struct track *t, struct track_result *r,
                  struct square guess, bool seen)
{
    struct square crop = guess, next;
    double before = INFINITY, step;

    for (int i = 0; i < LAST_PASSES; i++) {
        if (i > 0 || !seen)
            track_encode(t, r, crop, false);
        else
            track_decode(&r->motion, t->said, crop, t->opt.size);
        next = track_next_crop(t, &r->motion);
        if (track_implausible(t, &r->motion, next, crop) ||
            (i > 0 && r->confidence < HOPELESS))
            break;
        step = (hypot(next.x - crop.x, next.y - crop.y)
                + fabs(next.size - crop.size)) / crop.size;
        if (step < SETTLED || (i >= FIRST_PASSES && step > DRIFTS * before))
            break;
        before = step;
        crop = next;
    }
    t->crop = crop;
    t->last = r->motion;
    t->has_thumb = thumb_make(t->thumb, t->input) > THUMB_FLAT;
    t->since_check = 0;
}
