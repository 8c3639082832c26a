/* Figures of a model on people with known truth: each is reenacted by their
 * own later frames, whole and with parts left out, and by the next person's.
 * Every protocol is the same walk over driven frames, with another visitor. */
#include "lib/lab/eval/people.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/branch.h"
#include "lib/base/camera.h"
#include "lib/lab/eval/image.h"
#include "lib/lab/eval/motion.h"

#define STRIDE 5                /* ablations and cross draw every fifth frame */
#define SHEET_ROWS 8
#define SHEET_COLS 8

/* An evaluation under way. */
struct people {
    struct table *t;
    struct reenactor *s;
    const struct people_options *opt;
    struct contact_sheet *sheet;
    size_t S;
    float *truth, *source;      /* (S,S,3) over black */
    float *a, *b;               /* (3,S,S) planar */
    float *verts, *rest;        /* (V,3) driven; in the rest pose */
    double *curve[4];           /* jaw found, true; lid found, true */
    size_t n, room, person;

    /* of one protocol */
    struct identity id;         /* the true shape */
    const char *row;            /* of the table */
    size_t show;                /* the frame for the contact sheet */
    double source_colour[3];
};

/* What a protocol does with a driven frame: it is drawn, and its truth lies in
 * e->truth. */
typedef int people_visit_fn(struct people *e, const struct driven *st,
                            const struct data_frame *f, size_t i,
                            struct error *err);

static const struct {
    const char *name;
    unsigned without;
} ablation[] = {
    {"w/o dynamic", WITHOUT_DYNAMIC}, {"w/o static", WITHOUT_STATIC},
    {"w/o mouth", WITHOUT_MOUTH},     {"w/o interp", WITHOUT_INTERP},
    {"w/o deform", WITHOUT_DEFORM},   {"w/o neck", WITHOUT_NECK},
};

/* A value into a cell. */
static void people_add(struct people *e, const char *row, const char *column,
                       int better, double value)
{
    table_add(e->t, table_row(e->t, row), table_column(e->t, column, better),
              value);
}

/* Interleaved to planar, rounded to 8 bits as a file would hold it. */
static void people_planar(float *out, const float *rgb, size_t n)
{
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++)
            out[c * n + i] =
                roundf(255 * fminf(1, fmaxf(0, rgb[3 * i + c]))) / 255;
}

/* Mean squared error of e->b against e->a inside a box. */
static double people_box_mse(const struct people *e, struct box box)
{
    size_t S = e->S;
    double sum = 0;

    for (size_t c = 0; c < 3; c++)
        for (size_t y = box.y0; y < box.y1; y++)
            for (size_t x = box.x0; x < box.x1; x++) {
                size_t i = (c * S + y) * S + x;
                double d = (double)e->a[i] - e->b[i];
                sum += d * d;
            }
    return sum / (double)(3 * (box.x1 - box.x0) * (box.y1 - box.y0));
}

/* Picture figures of rgb against the truth f, which lies in e->a; the picture
 * is rounded to 8 bits, as a file would hold it. */
static int people_picture(struct people *e, const char *row, const float *rgb,
                          const struct data_frame *f, bool full,
                          struct error *err)
{
    struct box mouth = data_mouth(f, e->S);
    size_t n = e->S * e->S;
    struct metric_ssim s;
    struct metric_msssim m;
    double distance;

    people_planar(e->b, rgb, n);
    people_add(e, row, "psnr", 1, metric_psnr(metric_mse(e->a, e->b, 3 * n)));
    people_add(e, row, "l1", -1, metric_l1(e->a, e->b, 3 * n));
    if (metric_ssim(&s, NULL, NULL, e->a, e->b, 3, e->S, e->S, err))
        return -1;
    people_add(e, row, "ssim", 1, s.mean);
    if (e->opt->lpips) {
        if (lpips_distance(&distance, e->opt->lpips, e->a, e->b, e->S, e->S,
                           err))
            return -1;
        people_add(e, row, "lpips", -1, distance);
    }
    if (!box_is_empty(mouth))
        people_add(e, row, "psnr_mouth", 1,
                   metric_psnr(people_box_mse(e, mouth)));
    if (!full || e->S < METRIC_MSSSIM_MIN)
        return 0;
    if (metric_msssim(&m, NULL, e->a, e->b, 3, e->S, e->S, err))
        return -1;
    people_add(e, row, "msssim", 1, m.mean);
    return 0;
}

/* Distance of the outer eye corners in pixels as if seen from the front at
 * the head's true distance: does not shrink when the head turns. */
static double people_eye_pixels(const struct people *e,
                                const struct data_frame *f)
{
    struct head_motion rest = {.exp = NULL};
    float x[68 * 3];
    double d = 0;

    head_pose(e->rest, &e->id, &rest);
    head_landmarks(x, e->s->head, e->rest);
    for (int k = 0; k < 3; k++)
        d += pow((double)x[3 * 36 + k] - x[3 * 45 + k], 2);
    return sqrt(d) * camera_focal((float)f->size) / f->motion.t[2];
}

/* Motion figures of what the encoder found in a frame. */
static void people_motion(struct people *e, const struct driven *st,
                          const struct data_frame *f)
{
    const struct head *h = e->s->head;
    float x[68 * 3], uv[68][2];
    double found[3], true_[3], to512 = 512 / (double)f->size;
    struct metric_points p;
    static const char *const angle[3] = {"yaw_deg", "pitch_deg", "roll_deg"};
    double mean = 0;

    metric_euler_degrees(found, st->motion.R);
    metric_euler_degrees(true_, f->motion.R);
    for (int k = 0; k < 3; k++) {
        double d = fabs(remainder(found[k] - true_[k], 360));
        people_add(e, "SpiD", angle[k], -1, d);
        mean += d / 3;
    }
    people_add(e, "SpiD", "pose_deg", -1, mean);
    people_add(e, "SpiD", "geodesic_deg", -1,
               metric_rotation_degrees(st->motion.R, f->motion.R));
    head_landmarks(x, h, st->verts);
    camera_project(&uv[0][0], NULL, st->cam, (float)f->size, x, 68);
    metric_points(&p, (const float(*)[2])f->lmk, (const float(*)[2])uv);
    people_add(e, "SpiD", "akd", -1, p.akd * to512);
    people_add(e, "SpiD", "aed", -1, p.aed * to512);
    people_add(e, "SpiD", "apd", -1, p.apd * to512);
    people_add(e, "SpiD", "landmark_pct", -1,
               100 * p.akd / people_eye_pixels(e, f));
    people_add(e, "SpiD", "landmark_pct_2d", -1,
               100 * p.akd / metric_eye_distance((const float(*)[2])f->lmk));
    if (e->n < e->room) {
        e->curve[0][e->n] = metric_jaw_open(st->motion.pose.jaw);
        e->curve[1][e->n] = metric_jaw_open(f->motion.pose.jaw);
        e->curve[2][e->n] = 0.5 * (st->motion.pose.lid[0] + st->motion.pose.lid[1]);
        e->curve[3][e->n++] = 0.5 * (f->motion.pose.lid[0] +
                                     f->motion.pose.lid[1]);
    }
}

/* The driven frame: motion found in crop *q, which then follows the face. */
static int people_drive(struct people *e, struct driven *st,
                        const struct data_frame *f, struct square *q,
                        struct error *err)
{
    st->verts = e->verts;
    if (reenactor_motion(e->s, st, f, *q, err))
        return -1;
    /* A second pass where the first crop was off, as spid-motion makes it. */
    *q = reenactor_follow(e->s, st, f->size);
    if (reenactor_motion(e->s, st, f, *q, err))
        return -1;
    *q = reenactor_follow(e->s, st, f->size);
    return 0;
}

/* Frames of a person that are driven: all but the first, the source. */
static size_t people_frames(const struct people *e,
                            const struct data_person *p)
{
    size_t max = e->opt->frames ? e->opt->frames : p->count;

    return p->count < max ? p->count : max;
}

/* Source p, with parts left out, driven by d: every frame is tracked, every
 * stride-th drawn and visited. */
static int people_visit_frames(struct people *e, const struct data_person *p,
                               const struct data_person *d, unsigned without,
                               size_t stride, people_visit_fn *visit,
                               struct error *err)
{
    size_t count = people_frames(e, d);
    struct square q = d->frame[0].crop;

    if (reenactor_source(e->s, &p->frame[0], without, err))
        return -1;
    for (size_t i = 1; i < count; i++) {
        const struct data_frame *f = &d->frame[i];
        struct driven st;

        if (people_drive(e, &st, f, &q, err))
            return -1;
        if (i % stride)
            continue;
        if (reenactor_draw(e->s, &st.motion, err) ||
            data_portrait(e->truth, NULL, e->S, f, err))
            return -1;
        /* what hides the person counts for neither */
        data_mask_occluded(e->truth, e->s->rgb, 3, e->S, f);
        data_mask_occluded(e->s->coarse, e->s->rgb, 3, e->S, f);
        people_planar(e->a, e->truth, e->S * e->S);
        if (visit(e, &st, f, i, err))
            return -1;
    }
    return 0;
}

/* ---- driven by themselves ----------------------------------------------- */

/* The row of a person: pictures, error, branches. */
static int people_sheet_row(struct people *e, const struct driven *st,
                            struct error *err)
{
    struct reenactor *s = e->s;
    size_t row = e->person;

    contact_sheet_picture(e->sheet, row, 0, e->source, NULL);
    contact_sheet_picture(e->sheet, row, 1, e->truth, NULL);
    contact_sheet_picture(e->sheet, row, 2, s->coarse, NULL);
    contact_sheet_picture(e->sheet, row, 3, s->rgb, NULL);
    contact_sheet_difference(e->sheet, row, 4, s->rgb, e->truth);
    for (int b = 0; b < BRANCH_COUNT; b++) {
        const float *rgb;

        if (reenactor_draw_branch(&rgb, s, (enum avatar_branch)b, &st->motion,
                                  err))
            return -1;
        contact_sheet_picture(e->sheet, row, 5 + (size_t)b, rgb, NULL);
    }
    return 0;
}

/* The frame with the widest jaw: what the sheet shows. */
static size_t people_widest(const struct data_person *p, size_t count)
{
    size_t best = 1;

    for (size_t i = 1; i < count; i++)
        if (p->frame[i].motion.pose.jaw[0] > p->frame[best].motion.pose.jaw[0])
            best = i;
    return best;
}

/* Motion figures, and pictures of SpiD, SpiD* and the unchanged source. */
static int people_visit_self(struct people *e, const struct driven *st,
                             const struct data_frame *f, size_t i,
                             struct error *err)
{
    people_motion(e, st, f);
    if (people_picture(e, "SpiD", e->s->rgb, f, true, err) ||
        people_picture(e, "SpiD*", e->s->coarse, f, true, err) ||
        people_picture(e, "source", e->source, f, true, err))
        return -1;
    if (e->opt->ablations && i % STRIDE == 0 &&
        people_picture(e, "w/o nothing", e->s->coarse, f, false, err))
        return -1;
    if (e->sheet && i == e->show && e->person < e->sheet->rows &&
        people_sheet_row(e, st, err))
        return -1;
    return 0;
}

/* A person driven by themselves. */
static int people_self(struct people *e, const struct data_person *p,
                       struct error *err)
{
    int rc = -1;

    e->show = people_widest(p, people_frames(e, p));
    if (head_fold(&e->id, e->s->head, p->shape, e->s->head->nshape, err) ==
            0 &&
        data_portrait(e->source, NULL, e->S, &p->frame[0], err) == 0)
        rc = people_visit_frames(e, p, p, 0, 1, people_visit_self, err);
    identity_release(&e->id);
    return rc;
}

/* ---- ablations ---------------------------------------------------------- */

/* Pictures of SpiD* without something. */
static int people_visit_ablation(struct people *e, const struct driven *st,
                                 const struct data_frame *f, size_t i,
                                 struct error *err)
{
    (void)st, (void)i;
    return people_picture(e, e->row, e->s->coarse, f, false, err);
}

/* Every ablation of SpiD*, on every stride-th frame. */
static int people_ablate(struct people *e, const struct data_person *p,
                         struct error *err)
{
    for (size_t k = 0; k < sizeof ablation / sizeof *ablation; k++) {
        if (ablation[k].without == WITHOUT_DEFORM &&
            !e->s->model->config.init_width)
            continue;               /* this model has no Phi_init */
        e->row = ablation[k].name;
        if (people_visit_frames(e, p, p, ablation[k].without, STRIDE,
                                people_visit_ablation, err))
            return -1;
    }
    return 0;
}

/* ---- driven by another -------------------------------------------------- */

/* Mean colour of a picture where it is not black, inside the box. */
static void people_colour(double c[3], const float *rgb, size_t S,
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

/* Mean absolute difference. */
static double people_colour_distance(const double a[3], const double b[3])
{
    return (fabs(a[0] - b[0]) + fabs(a[1] - b[1]) + fabs(a[2] - b[2])) / 3;
}

/* Whose colours and whose pose the result has. */
static int people_visit_cross(struct people *e, const struct driven *st,
                              const struct data_frame *f, size_t i,
                              struct error *err)
{
    const struct box face = data_face(f, e->S);
    double driver[3], result[3];

    (void)i, (void)err;
    people_colour(driver, e->truth, e->S, face);
    people_colour(result, e->s->rgb, e->S, face);
    people_add(e, "cross", "colour_to_source", -1,
               people_colour_distance(result, e->source_colour));
    people_add(e, "cross", "colour_to_driver", 1,
               people_colour_distance(result, driver));
    people_add(e, "cross", "pose_deg", -1,
               metric_rotation_degrees(st->motion.R, f->motion.R));
    return 0;
}

/* Source p driven by d: the motion the encoder reads in the driver against
 * the truth, the result's colour against both people's. */
static int people_cross(struct people *e, const struct data_person *p,
                        const struct data_person *d, struct error *err)
{
    if (data_portrait(e->source, NULL, e->S, &p->frame[0], err))
        return -1;
    people_colour(e->source_colour, e->source, e->S,
                  data_face(&p->frame[0], e->S));
    return people_visit_frames(e, p, d, 0, STRIDE, people_visit_cross,
                               err);
}

/* ---- all of them -------------------------------------------------------- */

/* Every protocol on one person; driver NULL: nobody comes next. */
static int people_evaluate_one(struct people *e, const struct data_person *p,
                               const struct data_person *driver,
                               struct error *err)
{
    if (p->count < 2)
        return error_set(err, EX_DATAERR,
                         "person %d has %zu frame%s "
                         "(expected a source and at least one more)",
                         p->id, p->count, plural(p->count));
    e->s->beta = p->shape;
    if (people_self(e, p, err) ||
        (e->opt->ablations && people_ablate(e, p, err)))
        return -1;
    return e->opt->cross && driver ? people_cross(e, p, driver, err) : 0;
}

/* Pictures, meshes and curves. */
static int people_allocate(struct people *e, struct error *err)
{
    size_t n = e->S * e->S, V = e->s->head->V;

    e->room = e->opt->people * (e->opt->frames ? e->opt->frames : 1000);
    e->truth = malloc((4 * 3 * n + 6 * V) * sizeof *e->truth);
    e->curve[0] = malloc((4 * e->room + 1) * sizeof *e->curve[0]);
    if (!e->truth || !e->curve[0]) {
        free(e->truth);
        free(e->curve[0]);
        return error_set(err, EX_OSERR, "out of memory");
    }
    e->source = e->truth + 3 * n;
    e->a = e->source + 3 * n;
    e->b = e->a + 3 * n;
    e->verts = e->b + 3 * n;
    e->rest = e->verts + 3 * V;
    for (int k = 1; k < 4; k++)
        e->curve[k] = e->curve[0] + (size_t)k * e->room;
    return 0;
}

/* Each person of `in`, driven by the next one too; two are in memory at a
 * time. */
static int people_evaluate_all(struct people *e, struct data_reader *in,
                               struct error *err)
{
    const struct people_options *opt = e->opt;
    struct data_person p[2] = {{0}, {0}};
    int end;

    data_once(in);
    for (end = data_next(in, &p[0], err); !end;) {
        struct data_person *now = &p[e->person % 2];
        struct data_person *next = &p[(e->person + 1) % 2];

        end = e->person + 1 < opt->people ? data_next(in, next, err) : 1;
        if (end < 0 || people_evaluate_one(e, now, end ? NULL : next, err)) {
            end = -1;
            break;
        }
        data_person_release(now);
        e->person++;
        if (opt->progress)
            opt->progress(e->person, opt->people);
    }
    data_person_release(&p[0]);
    data_person_release(&p[1]);
    return end < 0 ? -1 : 0;
}

int people_evaluate(struct table *t, struct contact_sheet *sheet,
                    struct reenactor *s, const struct people_options *opt,
                    struct error *err)
{
    struct people e = {.t = t,
                       .s = s,
                       .opt = opt,
                       .S = s->model->config.size,
                       .sheet = sheet};
    struct data_reader *in = data_open(&opt->stream, 1, 0, err);
    int rc = -1;

    if (!in || people_allocate(&e, err)) {
        data_close(in);
        return -1;
    }
    if (sheet && contact_sheet_init(sheet, opt->people < SHEET_ROWS
                                               ? opt->people : SHEET_ROWS,
                                    SHEET_COLS, e.S, err))
        goto out;
    if (people_evaluate_all(&e, in, err))
        goto out;
    people_add(&e, "SpiD", "jaw_corr", 1,
               metric_correlation(e.curve[0], e.curve[1], e.n));
    people_add(&e, "SpiD", "blink_corr", 1,
               metric_correlation(e.curve[2], e.curve[3], e.n));
    rc = 0;
out:
    if (rc && sheet)
        contact_sheet_release(sheet);
    data_close(in);
    free(e.truth);
    free(e.curve[0]);
    return rc;
}

/* ---- what papers name ---------------------------------------------------- */

static const struct {
    const char *key, *row, *column;
} figure[] = {
    {"psnr", "SpiD", "psnr"},
    {"ssim", "SpiD", "ssim"},
    {"msssim", "SpiD", "msssim"},
    {"l1", "SpiD", "l1"},
    {"psnr_star", "SpiD*", "psnr"},
    {"ssim_star", "SpiD*", "ssim"},
    {"psnr_source", "source", "psnr"},
    {"ssim_source", "source", "ssim"},
    {"pose_deg", "SpiD", "pose_deg"},
    {"yaw_deg", "SpiD", "yaw_deg"},
    {"pitch_deg", "SpiD", "pitch_deg"},
    {"roll_deg", "SpiD", "roll_deg"},
    {"landmark_pct", "SpiD", "landmark_pct"},
    {"landmark_pct_2d", "SpiD", "landmark_pct_2d"},
    {"akd", "SpiD", "akd"},
    {"aed", "SpiD", "aed"},
    {"apd", "SpiD", "apd"},
    {"jaw_corr", "SpiD", "jaw_corr"},
    {"blink_corr", "SpiD", "blink_corr"},
    {"cross_colour_to_source", "cross", "colour_to_source"},
    {"cross_colour_to_driver", "cross", "colour_to_driver"},
};

/* The mean in the row and column of these names; NaN when there is none. */
static double summary_figure(const struct table *t, const char *row,
                             const char *column)
{
    size_t r = 0, c = 0;

    while (r < t->rows && strcmp(t->row[r].name, row))
        r++;
    while (c < t->columns && strcmp(t->column[c], column))
        c++;
    return table_mean(t, r, c);
}

void summary_write(FILE *f, const struct table *t)
{
    cJSON *json = cJSON_CreateObject();

    for (size_t i = 0; i < sizeof figure / sizeof *figure; i++)
        cJSON_AddNumberToObject(json, figure[i].key,
                                summary_figure(t, figure[i].row,
                                               figure[i].column));
    cJSON_AddItemToObject(json, "rows", table_json(t));
    table_put_json(f, json);
}
