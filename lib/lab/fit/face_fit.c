/* The rounds of the fit: which step follows which (face_fit.h), people in
 * parallel, and where cameras and windows start. */
#include "lib/lab/fit/face_fit.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/sort.h"
#include "lib/base/camera.h"
#include "lib/lab/people/label_rows.h"

#define N LANDMARK_FACE
#define FIT_CALM 4              /* a quarter of the frames is calm */

/* ---- beginning ----------------------------------------------------------- */

/* The window of frames first .. first+n of a clip: about their mean box. */
static void fit_window(struct fit_frame *frame, size_t n)
{
    struct square q = {0};

    for (size_t i = 0; i < n; i++) {
        float xy[LANDMARK_BOX][2];

        for (int k = 0; k < LANDMARK_BOX; k++)
            for (int c = 0; c < 2; c++)
                xy[k][c] = (float)frame[i].label->at[landmark_box[k]][c];
        struct square one = crop_from_landmarks(xy[0], LANDMARK_BOX);
        q.x += one.x / (double)n;
        q.y += one.y / (double)n;
        q.size += one.size / (double)n;
    }
    q = window_from_crop(q);
    q.size = fmax(q.size, 1);
    for (size_t i = 0; i < n; i++) {
        frame[i].window = q;
        for (int k = 0; k < LANDMARK_COUNT; k++) {
            const double *at = frame[i].label->at[k];

            frame[i].at[k][0] = (at[0] - q.x) * FIT_SIZE / q.size +
                                FIT_SIZE / 2;
            frame[i].at[k][1] = (at[1] - q.y) * FIT_SIZE / q.size +
                                FIT_SIZE / 2;
        }
    }
}

/* How much a frame's face does. */
static double fit_expression_sum(const struct label *l)
{
    double sum = 0;

    for (int k = 0; k < ARKIT_COUNT; k++)
        if (k < ARKIT_EYE_LOOK_DOWN_L || k > ARKIT_EYE_LOOK_UP_R)
            sum += l->blend[k];
    return sum;
}

/* The calmest quarter of a person's frames, at least one, and with it what
 * the blendshapes' changes mean.  scratch (count). */
static void fit_find_calm(struct fit_frame *frame, size_t n, double *scratch)
{
    double base[ARKIT_COUNT] = {0}, max;
    size_t calm = 0;

    for (size_t i = 0; i < n; i++)
        scratch[i] = fit_expression_sum(frame[i].label);
    sort_doubles(scratch, n);
    max = scratch[n > FIT_CALM ? n / FIT_CALM - 1 : 0];
    for (size_t i = 0; i < n; i++) {
        frame[i].calm = fit_expression_sum(frame[i].label) <= max;
        calm += frame[i].calm;
        for (int k = 0; frame[i].calm && k < ARKIT_COUNT; k++)
            base[k] += frame[i].label->blend[k];
    }
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < ARKIT_COUNT; k++)
            frame[i].prior[k] = fmin(fmax(
                label_gain(k) * (frame[i].label->blend[k] -
                               base[k] / (double)calm), 0), 1);
}

double fit_lid_gap(const double (*xy)[2], int side, const double down[2])
{
    const double *a = xy[landmark_corner[side][0]];
    const double *b = xy[landmark_corner[side][1]];
    double sum = 0;

    for (int i = 0; i < LANDMARK_GAP; i++) {
        const double *u = xy[landmark_upper[side][i]];
        const double *l = xy[landmark_lower[side][i]];

        sum += (l[0] - u[0]) * down[0] + (l[1] - u[1]) * down[1];
    }
    return sum / LANDMARK_GAP / fmax(hypot(a[0] - b[0], a[1] - b[1]), 1e-6);
}

/* How far each lid is closed against the person's open eyes: the gap that a
 * quarter of the frames exceeds.  scratch (count). */
static void fit_find_closed(struct fit_frame *frame, size_t n, double *scratch)
{
    for (int side = 0; side < 2; side++) {
        for (size_t i = 0; i < n; i++) {
            const double (*at)[2] = (const double (*)[2])frame[i].at;
            double down[2] = {at[152][0] - at[10][0], at[152][1] - at[10][1]};
            double length = fmax(hypot(down[0], down[1]), 1e-6);

            down[0] /= length;
            down[1] /= length;
            scratch[i] = frame[i].closed[side] = fit_lid_gap(at, side, down);
        }
        sort_doubles(scratch, n);
        double open = fmax(scratch[n - 1 - (n - 1) / 4], 0.05);
        for (size_t i = 0; i < n; i++)
            frame[i].closed[side] = fmin(fmax(
                1 - frame[i].closed[side] / open, 0), 1);
    }
}

/* A first camera: from the front, by place and extent. */
static void fit_first_camera(const struct face_fit *f, struct fit_frame *a)
{
    double mean[3] = {0}, at[2] = {0}, spread = 0, extent = 0;

    for (int i = 0; i < N; i++) {
        for (int c = 0; c < 3; c++)
            mean[c] += f->points->rest[i][c] / N;
        for (int c = 0; c < 2; c++)
            at[c] += a->at[i][c] / N;
    }
    for (int i = 0; i < N; i++) {
        spread += hypot(a->at[i][0] - at[0], a->at[i][1] - at[1]);
        extent += hypot(f->points->rest[i][0] - mean[0],
                        f->points->rest[i][1] - mean[1]);
    }
    memset(a->R, 0, sizeof a->R);
    a->R[0] = 1;
    a->R[4] = a->R[8] = -1;
    double scale = fmax(spread / extent, 1e-3);     /* pixels per head unit */
    a->t[0] = (at[0] - FIT_SIZE / 2) / scale - mean[0];
    a->t[1] = (at[1] - FIT_SIZE / 2) / scale + mean[1];
    a->t[2] = (double)camera_focal((float)FIT_SIZE) / scale + mean[2];
}

/* A person's frames from the labels. */
static void fit_begin_person(struct face_fit *f, struct fit_person *p,
                             double *scratch)
{
    struct fit_frame *frame = f->frame + p->first;

    for (size_t i = 0, n; i < p->count; i += n) {
        for (n = 1; i + n < p->count &&
             frame[i + n].label->clip == frame[i].label->clip; n++)
            ;
        fit_window(frame + i, n);
    }
    fit_find_calm(frame, p->count, scratch);
    fit_find_closed(frame, p->count, scratch);
    for (size_t i = 0; i < p->count; i++) {
        memcpy(frame[i].w, frame[i].prior, sizeof frame[i].w);
        for (int k = ARKIT_EYE_BLINK_L; k <= ARKIT_EYE_LOOK_UP_R; k++)
            frame[i].w[k] = 0;
        fit_first_camera(f, &frame[i]);
    }
    face_points_fold(&p->face, f->points, p->beta);
    for (size_t i = 0; i < p->count; i++)
        fit_pose(f, p, &frame[i], 12);
}

int face_fit_init(struct face_fit *f, const struct face_points *p,
                  const struct labels *l, struct error *err)
{
    double *scratch;

    memset(f, 0, sizeof *f);
    f->points = p;
    f->count = l->count;
    f->people = l->people;
    f->frame = arena_take(&f->memory, l->count, sizeof *f->frame);
    f->person = arena_take(&f->memory, l->people, sizeof *f->person);
    scratch = arena_take(&f->memory, l->count, sizeof *scratch);
    if (arena_check(&f->memory, "labels", err)) {
        face_fit_release(f);
        return -1;
    }
    for (size_t i = 0; i < l->count; i++) {
        struct fit_person *who = &f->person[l->label[i].person];

        f->frame[i].label = &l->label[i];
        if (!who->count++)
            who->first = i;
    }
    for (size_t i = 0; i < f->people; i++)
        fit_begin_person(f, &f->person[i], scratch);
    return 0;
}

void face_fit_release(struct face_fit *f)
{
    arena_release(&f->memory);
    memset(f, 0, sizeof *f);
}

/* ---- rounds -------------------------------------------------------------- */

/* Camera, gaze, lids and expression of a person's frames. */
static int fit_frames(void *fit, size_t person, struct error *err)
{
    struct face_fit *f = fit;
    struct fit_person *p = &f->person[person];

    for (size_t i = 0; i < p->count; i++) {
        struct fit_frame *frame = &f->frame[p->first + i];

        fit_gaze(p, frame);
        fit_lids(f, p, frame);
        if (fit_expression(f, p, frame, err))
            return -1;
        fit_lids(f, p, frame);
        fit_pose(f, p, frame, 2);
    }
    return 0;
}

/* The shape with the poses held, then the poses with the shape held. */
static int fit_identity_and_pose(void *fit, size_t person, struct error *err)
{
    struct face_fit *f = fit;
    struct fit_person *p = &f->person[person];

    if (fit_identity(f, p, err))
        return -1;
    for (size_t i = 0; i < p->count; i++)
        fit_pose(f, p, &f->frame[p->first + i], 2);
    return 0;
}

/* Every person, in any order. */
int face_fit_round(struct face_fit *f, struct error *err)
{
    if (parallel_try(f->people, fit_identity_and_pose, f, err) ||
        fit_offsets(f, err))
        return -1;
    fit_iris(f);
    return parallel_try(f->people, fit_frames, f, err);
}

double face_fit_error(const struct face_fit *f)
{
    double sum = 0, x[N][3], uv[2];

    for (size_t k = 0; k < f->count; k++) {
        const struct fit_frame *frame = &f->frame[k];

        fit_points(x, f, &f->person[frame->label->person], frame);
        for (int i = 0; i < N; i++) {
            fit_project(uv, NULL, NULL, frame, x[i]);
            sum += hypot(uv[0] - frame->at[i][0], uv[1] - frame->at[i][1]) / N;
        }
    }
    return sum / (double)f->count;
}

/* ---- results ------------------------------------------------------------- */

void face_fit_motion(struct motion *m, const struct face_fit *f, size_t k)
{
    const struct fit_frame *a = &f->frame[k];
    float w[ARKIT_COUNT];

    memset(m, 0, sizeof *m);
    for (int i = 0; i < ARKIT_COUNT; i++)
        w[i] = (float)a->w[i];
    arkit_to_motion(m->exp, ARKIT_EXP, m->pose.jaw, m->pose.lid, m->pose.eye,
                    w);
    m->pose.exp = m->exp;
    for (int i = 0; i < 9; i++)
        m->R[i] = (float)a->R[i];
    for (int i = 0; i < 3; i++)
        m->t[i] = (float)a->t[i];
}
