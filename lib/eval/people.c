#include "lib/eval/people.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"
#include "lib/metric/image.h"
#include "lib/metric/motion.h"

/* What judging needs beside the subject. */
struct judge {
    struct table *t;
    struct subject *s;
    const struct people_options *opt;
    struct sheet *sheet;
    size_t S;
    float *truth, *source;      /* (S,S,3) over black */
    float *a, *b;               /* (3,S,S) planar */
    float *rgb, *alpha;         /* of one branch */
    float *verts;               /* (V,3) driven */
    double *curve[4];           /* jaw found, true; lid found, true */
    size_t n, room, person;
};

static const struct {
    const char *name;
    unsigned without;
} ablation[] = {
    {"w/o dynamic", WITHOUT_DYNAMIC}, {"w/o static", WITHOUT_STATIC},
    {"w/o mouth", WITHOUT_MOUTH},     {"w/o interp", WITHOUT_INTERP},
    {"w/o deform", WITHOUT_DEFORM},
    {"w/o bend", WITHOUT_NECK},
};

static void add(struct judge *j, const char *row, const char *column,
                int better, double value)
{
    table_add(j->t, table_row(j->t, row), table_column(j->t, column, better),
              value);
}

static void planar(float *out, const float *rgb, size_t n)
{
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++)
            out[c * n + i] = roundf(255 * fminf(1, fmaxf(0, rgb[3 * i + c])))
                             / 255;
}

/* Mean squared error of j->b against j->a inside a box. */
static double box_mse(const struct judge *j, struct box box)
{
    size_t S = j->S;
    double sum = 0;

    for (size_t c = 0; c < 3; c++)
        for (size_t y = box.y0; y < box.y1; y++)
            for (size_t x = box.x0; x < box.x1; x++) {
                size_t i = (c * S + y) * S + x;
                double d = (double)j->a[i] - j->b[i];
                sum += d * d;
            }
    return sum / (double)(3 * (box.x1 - box.x0) * (box.y1 - box.y0));
}

/* Picture figures of rgb against the truth f, which lies in j->a; the picture
 * is rounded to 8 bits, as a file would hold it. */
static int picture(struct judge *j, const char *row, const float *rgb,
                   const struct data_frame *f, int full, struct error *err)
{
    struct box mouth = avatar_system_mouth(f, j->S);
    size_t n = j->S * j->S;
    struct metric_ssim s;
    struct metric_msssim m;

    planar(j->b, rgb, n);
    add(j, row, "psnr", 1, metric_psnr(metric_mse(j->a, j->b, 3 * n)));
    add(j, row, "l1", -1, metric_l1(j->a, j->b, 3 * n));
    if (metric_ssim(&s, NULL, NULL, j->a, j->b, 3, j->S, j->S, err))
        return -1;
    add(j, row, "ssim", 1, s.mean);
    if (mouth.x1 > mouth.x0 && mouth.y1 > mouth.y0)
        add(j, row, "psnr_mouth", 1, metric_psnr(box_mse(j, mouth)));
    if (!full || j->S < METRIC_MSSSIM_MIN)
        return 0;
    if (metric_msssim(&m, NULL, j->a, j->b, 3, j->S, j->S, err))
        return -1;
    add(j, row, "msssim", 1, m.mean);
    return 0;
}

/* Distance of the outer eye corners in pixels as if seen from the front at
 * the head's true distance: does not shrink when the head turns. */
static double eye_pixels(const struct judge *j, const struct identity *id,
                         const struct data_frame *f)
{
    struct head_motion rest = {.exp = NULL};
    float x[68 * 3];
    double d = 0;

    head_pose(j->s->tr.verts, id, &rest);
    head_landmarks(x, j->s->head, j->s->tr.verts);
    for (int k = 0; k < 3; k++)
        d += pow((double)x[3 * 36 + k] - x[3 * 45 + k], 2);
    return sqrt(d) * camera_focal((float)f->size) / f->motion.trans[2];
}

/* Motion figures of what the encoder found in a frame. */
static void motion(struct judge *j, const struct motion_state *st,
                   const struct data_frame *f, const struct identity *truth)
{
    const struct head *h = j->s->head;
    float x[68 * 3], uv[68][2];
    double e[3], et[3], to512 = 512.0 / (double)f->size;
    struct metric_points p;
    static const char *const angle[3] = {"yaw_deg", "pitch_deg", "roll_deg"};
    double mean = 0;

    metric_euler_degrees(e, st->R);
    metric_euler_degrees(et, f->motion.rot);
    for (int k = 0; k < 3; k++) {
        double d = fabs(remainder(e[k] - et[k], 360));
        add(j, "SpiD", angle[k], -1, d);
        mean += d / 3;
    }
    add(j, "SpiD", "pose_deg", -1, mean);
    add(j, "SpiD", "geodesic_deg", -1,
        metric_rotation_degrees(st->R, f->motion.rot));
    head_landmarks(x, h, st->verts);
    camera_project(&uv[0][0], NULL, st->cam, (float)f->size, x, 68);
    metric_points(&p, (const float(*)[2])f->lmk, (const float(*)[2])uv);
    add(j, "SpiD", "akd", -1, p.akd * to512);
    add(j, "SpiD", "aed", -1, p.aed * to512);
    add(j, "SpiD", "apd", -1, p.apd * to512);
    add(j, "SpiD", "landmark_pct", -1,
        100 * p.akd / eye_pixels(j, truth, f));
    add(j, "SpiD", "landmark_pct_2d", -1,
        100 * p.akd / metric_eye_distance((const float(*)[2])f->lmk));
    if (j->n < j->room) {
        j->curve[0][j->n] = metric_jaw_open(st->motion.jaw);
        j->curve[1][j->n] = metric_jaw_open(f->motion.jaw);
        j->curve[2][j->n] = 0.5 * (st->motion.lid[0] + st->motion.lid[1]);
        j->curve[3][j->n++] = 0.5 * (f->motion.lid[0] + f->motion.lid[1]);
    }
}

/* The driven frame: motion found in crop *q, which then follows the face. */
static int drive(struct judge *j, struct motion_state *st,
                 const struct data_frame *f, struct square *q,
                 struct error *err)
{
    st->verts = j->verts;
    if (subject_look(j->s, st, &j->s->id, f, *q, err))
        return -1;
    /* A second look where the first crop was off, as spid-motion does. */
    *q = subject_follow(j->s, st, f->size);
    if (subject_look(j->s, st, &j->s->id, f, *q, err))
        return -1;
    *q = subject_follow(j->s, st, f->size);
    return 0;
}

/* Frames of a person that are driven: all but the first, the source. */
static size_t frame_count(const struct judge *j, const struct data_person *p)
{
    size_t most = j->opt->frames ? j->opt->frames : p->count;

    return p->count < most ? p->count : most;
}

static int sheet_row(struct judge *j, const struct motion_state *st,
                     struct error *err)
{
    struct avatar_system *tr = &j->s->tr;
    size_t row = j->person;

    sheet_picture(j->sheet, row, 0, j->source, NULL);
    sheet_picture(j->sheet, row, 1, j->truth, NULL);
    sheet_picture(j->sheet, row, 2, tr->coarse, NULL);
    sheet_picture(j->sheet, row, 3, tr->rgb, NULL);
    sheet_difference(j->sheet, row, 4, tr->rgb, j->truth);
    for (int b = 0; b < BRANCH_COUNT; b++) {
        if (subject_branch(j->s, j->rgb, j->alpha, (enum avatar_branch)b,
                           st->verts, st->cam, err))
            return -1;
        sheet_picture(j->sheet, row, 5 + (size_t)b, j->rgb, NULL);
    }
    return 0;
}

/* The frame with the widest jaw: what the sheet shows. */
static size_t widest(const struct data_person *p, size_t count)
{
    size_t best = 1;

    for (size_t i = 1; i < count; i++)
        if (p->frame[i].motion.jaw[0] > p->frame[best].motion.jaw[0])
            best = i;
    return best;
}

static int self(struct judge *j, const struct data_person *p,
                struct error *err)
{
    size_t count = frame_count(j, p), show = widest(p, count);
    size_t n = j->S * j->S;
    struct square q = p->frame[0].crop;
    struct identity truth = {0};
    int rc = -1;

    if (head_fold(&truth, j->s->head, p->shape, j->s->head->nshape, err) ||
        subject_source(j->s, &p->frame[0], 0, err) ||
        data_portrait(j->source, NULL, j->S, &p->frame[0], err))
        goto out;
    for (size_t i = 1; i < count; i++) {
        const struct data_frame *f = &p->frame[i];
        struct motion_state st;
        if (drive(j, &st, f, &q, err))
            goto out;
        motion(j, &st, f, &truth);
        if (avatar_system_draw(&j->s->tr, st.verts, st.cam, err) ||
            data_portrait(j->truth, NULL, j->S, f, err))
            goto out;
        planar(j->a, j->truth, n);
        if (picture(j, "SpiD", j->s->tr.rgb, f, 1, err) ||
            picture(j, "SpiD*", j->s->tr.coarse, f, 1, err) ||
            picture(j, "source", j->source, f, 1, err))
            goto out;
        if (j->opt->ablations && i % j->opt->stride == 0 &&
            picture(j, "w/o nothing", j->s->tr.coarse, f, 0, err))
            goto out;
        if (j->sheet && i == show && j->person < j->sheet->rows &&
            sheet_row(j, &st, err))
            goto out;
    }
    rc = 0;
out:
    identity_release(&truth);
    return rc;
}

/* One ablation of SpiD*, on every stride-th frame. */
static int ablate(struct judge *j, const struct data_person *p, size_t k,
                  struct error *err)
{
    size_t count = frame_count(j, p);
    struct square q = p->frame[0].crop;

    if (subject_source(j->s, &p->frame[0], ablation[k].without, err))
        return -1;
    for (size_t i = 1; i < count; i++) {
        const struct data_frame *f = &p->frame[i];
        struct motion_state st;
        if (drive(j, &st, f, &q, err))
            return -1;
        if (i % j->opt->stride)
            continue;
        if (avatar_system_draw(&j->s->tr, st.verts, st.cam, err) ||
            data_portrait(j->truth, NULL, j->S, f, err))
            return -1;
        planar(j->a, j->truth, j->S * j->S);
        if (picture(j, ablation[k].name, j->s->tr.coarse, f, 0, err))
            return -1;
    }
    return 0;
}

/* Mean colour of a picture where it is not black, inside the box. */
static void face_colour(double c[3], const float *rgb, size_t S,
                        struct box box)
{
    double n = 1e-9;

    c[0] = c[1] = c[2] = 0;
    for (size_t y = box.y0; y < box.y1; y++)
        for (size_t x = box.x0; x < box.x1; x++) {
            const float *p = rgb + 3 * (y * S + x);
            if (p[0] + p[1] + p[2] < 0.02f)
                continue;
            for (int k = 0; k < 3; k++)
                c[k] += p[k];
            n++;
        }
    for (int k = 0; k < 3; k++)
        c[k] /= n;
}

static double colour_distance(const double a[3], const double b[3])
{
    return (fabs(a[0] - b[0]) + fabs(a[1] - b[1]) + fabs(a[2] - b[2])) / 3;
}

/* Source p driven by d: the motion the encoder reads in the result against
 * the driver's, the result's colour against both people's. */
static int cross(struct judge *j, const struct data_person *p,
                 const struct data_person *d, struct error *err)
{
    size_t count = frame_count(j, d);
    struct square q = d->frame[0].crop;
    double source[3], driver[3], result[3];

    if (subject_source(j->s, &p->frame[0], 0, err) ||
        data_portrait(j->source, NULL, j->S, &p->frame[0], err))
        return -1;
    face_colour(source, j->source, j->S,
                avatar_system_face(&p->frame[0], j->S));
    for (size_t i = 1; i < count; i++) {
        const struct data_frame *f = &d->frame[i];
        struct motion_state st;
        if (drive(j, &st, f, &q, err))
            return -1;
        if (i % j->opt->stride)
            continue;
        if (avatar_system_draw(&j->s->tr, st.verts, st.cam, err) ||
            data_portrait(j->truth, NULL, j->S, f, err))
            return -1;
        face_colour(driver, j->truth, j->S, avatar_system_face(f, j->S));
        face_colour(result, j->s->tr.rgb, j->S, avatar_system_face(f, j->S));
        add(j, "cross", "colour_to_source", -1,
            colour_distance(result, source));
        add(j, "cross", "colour_to_driver", 1,
            colour_distance(result, driver));
        add(j, "cross", "pose_deg", -1,
            metric_rotation_degrees(st.R, f->motion.rot));
    }
    return 0;
}

static int judge_person(struct judge *j, const struct data_person *p,
                        const struct data_person *driver, struct error *err)
{
    if (p->count < 2)
        return error_set(err, EX_DATAERR, "person %d has %zu frames "
                         "(expected a source and at least one more)", p->id,
                         p->count);
    j->s->beta = p->shape;
    if (self(j, p, err))
        return -1;
    for (size_t k = 0; j->opt->ablations &&
                       k < sizeof ablation / sizeof *ablation; k++)
        if (ablate(j, p, k, err))
            return -1;
    return j->opt->cross && driver ? cross(j, p, driver, err) : 0;
}

static int allocate(struct judge *j, struct error *err)
{
    size_t n = j->S * j->S, V = j->s->head->V;

    j->room = j->opt->people * (j->opt->frames ? j->opt->frames : 1000);
    j->truth = malloc((5 * 3 * n + n + 3 * V) * sizeof *j->truth);
    j->curve[0] = malloc((4 * j->room + 1) * sizeof *j->curve[0]);
    if (!j->truth || !j->curve[0]) {
        free(j->truth);
        free(j->curve[0]);
        return error_set(err, EX_OSERR, "out of memory");
    }
    j->source = j->truth + 3 * n;
    j->a = j->source + 3 * n;
    j->b = j->a + 3 * n;
    j->rgb = j->b + 3 * n;
    j->alpha = j->rgb + 3 * n;
    j->verts = j->alpha + n;
    for (int k = 1; k < 4; k++)
        j->curve[k] = j->curve[0] + (size_t)k * j->room;
    return 0;
}

int people_judge(struct table *t, struct sheet *sheet, struct subject *s,
                 const struct people_options *opt, struct error *err)
{
    struct judge j = {.t = t, .s = s, .opt = opt, .S = s->config.size,
                      .sheet = opt->sheet_rows ? sheet : NULL};
    struct data_reader *in = data_open(&opt->stream, 1, 0, err);
    struct data_person p[2] = {{0}, {0}};
    int rc = -1, end;

    if (!in || allocate(&j, err)) {
        data_close(in);
        return -1;
    }
    if (j.sheet && sheet_init(sheet, opt->sheet_rows, PEOPLE_SHEET_COLS, j.S,
                              err))
        goto out;
    data_once(in);
    for (end = data_next(in, &p[0], err); !end;) {
        struct data_person *now = &p[j.person % 2];
        struct data_person *next = &p[(j.person + 1) % 2];
        if (j.person + 1 < opt->people)
            end = data_next(in, next, err);
        else
            end = 1;
        if (end < 0 || judge_person(&j, now, end ? NULL : next, err))
            goto out;
        data_person_release(now);
        j.person++;
        if (opt->progress)
            opt->progress(j.person, opt->people);
    }
    if (end < 0)
        goto out;
    add(&j, "SpiD", "jaw_corr", 1,
        metric_correlation(j.curve[0], j.curve[1], j.n));
    add(&j, "SpiD", "blink_corr", 1,
        metric_correlation(j.curve[2], j.curve[3], j.n));
    rc = 0;
out:
    if (rc && j.sheet)
        sheet_release(sheet);
    data_person_release(&p[0]);
    data_person_release(&p[1]);
    data_close(in);
    free(j.truth);
    free(j.curve[0]);
    return rc;
}
