/* Further pictures of a person (views.h). */
#include "lib/track/views.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesource.h"
#include "formats/video.h"
#include "lib/base/camera.h"
#include "lib/base/vec3.h"

#define NEW 0.35        /* radians between heads of two pictures of a clip: an
                         * ear comes into view in twice as many */
#define STEP 0.5f       /* in brightness that counts at most: eyes that shut */
#define ROTATED 1.3      /* by which likeness falls with a radian between two
                         * heads (tests/bench/alike.sh) */

int views_init(struct views *v, const struct source *first,
               const struct head *head, struct encoders *nets,
               const struct track_options *opt, struct error *err)
{
    *v = (struct views){
        .first = first, .head = head, .nets = nets, .opt.size = opt->size,
        .opt.finest = opt->finest
    };
    return head_fold(&v->mean, head, NULL, 0, err);
}

void views_release(struct views *v)
{
    for (size_t k = 0; k < v->n; k++) {
        source_release(v->source + k);
        image_release(v->image + k);
    }
    identity_release(&v->mean);
    memset(v, 0, sizeof *v);
}

/* ---- one person? ----------------------------------------------------------- */

/* What a picture shows of the mean head's vertices: each in one row. */
struct views_face {
    float (*vert)[3], (*normal)[3];
    float *bright, *seen;       /* logarithm; 0 to 1 */
};

/* Logarithm of the brightness about a pixel of the portrait window. */
static float views_bright(const struct person *p, size_t x, size_t y)
{
    const size_t r = p->size / 256, last = p->size - 1;
    size_t sum = 0, n = 0;

    for (size_t v = y > r ? y - r : 0; v <= y + r && v <= last; v++)
        for (size_t u = x > r ? x - r : 0; u <= x + r && u <= last; u++, n++)
            for (size_t c = 0; c < 3; c++)
                sum += p->rgb[3 * (v * p->size + u) + c];
    return logf((float)sum / (765 * (float)n) + SRGB_DARK);
}

static void views_sample(struct views_face *f, const struct views *v,
                         const struct person *p)
{
    const int32_t *region = v->head->region;
    struct head_motion pose = p->source.pose;
    float cam[12], eye[3];

    pose.exp = p->source.exp;
    head_pose(*f->vert, &v->mean, &pose);
    head_normals(*f->normal, v->head, *f->vert);
    motion_camera(cam, &p->source);
    camera_origin(eye, cam);
    for (size_t k = 0; k < v->head->V; k++) {
        const float *x = f->vert[k], *n = f->normal[k];
        const float way[3] = {eye[0] - x[0], eye[1] - x[1], eye[2] - x[2]};
        const float cosine = (way[0] * n[0] + way[1] * n[1] + way[2] * n[2]) /
                             sqrtf(way[0] * way[0] + way[1] * way[1] +
                                   way[2] * way[2]);
        float at[2];

        camera_project(at, NULL, cam, p->size, x, 1);
        f->seen[k] = 0;
        if ((region && region[k] != REGION_SKIN && region[k] != REGION_FACE) ||
            !(at[0] >= 0 && at[1] >= 0 && at[0] < (float)p->size &&
              at[1] < (float)p->size))
            continue;
        f->seen[k] = fminf(fmaxf((cosine - 0.2f) / 0.4f, 0), 1);
        f->bright[k] = views_bright(p, (size_t)at[0], (size_t)at[1]);
    }
}

/* Correlation of the steps in brightness along the mesh's edges, which light
 * that changes slowly over a face hardly adds to; 0 where nothing is seen in
 * both. */
static double views_correlation(const struct views_face *a,
                                const struct views_face *b,
                                const struct head *h)
{
    double ab = 0, aa = 1e-9, bb = 1e-9;

    for (size_t i = 0; i < 3 * h->F; i++) {
        const size_t p = (size_t)h->f[i];
        const size_t q = (size_t)h->f[i % 3 == 2 ? i - 2 : i + 1];
        const float w = fminf(a->seen[p], b->seen[p]) *
                        fminf(a->seen[q], b->seen[q]);

        if (!(w > 0))
            continue;
        const float x = fminf(fmaxf(a->bright[q] - a->bright[p], -STEP), STEP);
        const float y = fminf(fmaxf(b->bright[q] - b->bright[p], -STEP), STEP);
        ab += (double)(w * x * y);
        aa += (double)(w * x * x);
        bb += (double)(w * y * y);
    }
    return ab / sqrt(aa * bb);
}

/* How much a face is like the first one: twice the correlation of the steps in
 * brightness along the mesh's edges that both pictures show, less the distance
 * of their shapes as E_beta has them, standard deviations, plus ROTATED for each
 * radian between the heads.  EX_OSERR. */
static int views_likeness(double *likeness, const struct views *v,
                          const struct source *s, struct error *err)
{
    const struct person *const p[2] = {&v->first->person, &s->person};
    const size_t V = v->head->V;
    float *block = malloc(2 * 8 * V * sizeof *block);
    struct views_face face[2];
    double apart = 0;

    if (!block)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", V);
    for (size_t i = 0; i < 2; i++) {
        float *at = block + i * 8 * V;

        face[i] = (struct views_face){(float (*)[3])at,
                                      (float (*)[3])(at + 3 * V), at + 6 * V,
                                      at + 7 * V};
        views_sample(face + i, v, p[i]);
    }
    for (size_t k = 0; k < p[0]->nshape; k++) {
        const double d = (double)p[0]->shape[k] - (double)p[1]->shape[k];

        apart += d * d;
    }
    *likeness = 2 * views_correlation(face, face + 1, v->head) - sqrt(apart) +
                ROTATED * rotation_distance(p[0]->source.R, p[1]->source.R);
    free(block);
    return 0;
}

/* ---- reading ---------------------------------------------------------------- */

/* Whether the head is turned another way than in every picture before. */
static bool views_is_new(const struct views *v, const float R[9])
{
    double min = rotation_distance(v->first->person.source.R, R);

    for (size_t k = 0; k < v->n; k++)
        min = fmin(min, rotation_distance(v->source[k].person.source.R, R));
    return min > NEW;
}

/* The picture im, which is taken over, as one more of the person: 1; 0: it shows
 * another; -1. */
static int views_take(struct views *v, struct views_report *r,
                      struct image *im, struct error *err)
{
    struct source *s = v->source + v->n;

    if (v->n == PERSON_MORE) {
        image_release(im);
        return error_set(err, EX_USAGE, "%zu further pictures already "
                         "(expected at most %d)", v->n, PERSON_MORE);
    }
    if (source_find(s, im, NULL, v->head, v->nets, &v->opt, err)) {
        image_release(im);
        return -1;
    }
    r->faces = s->notes.faces;
    if (views_likeness(&r->likeness, v, s, err)) {
        source_release(s);
        image_release(im);
        return -1;
    }
    r->stranger = r->likeness < VIEWS_SIMILAR;
    if (r->stranger) {
        source_release(s);
        image_release(im);
        return 0;
    }
    v->image[v->n++] = *im;
    r->taken++;
    return 1;
}

/* Frames of a clip until it ends, shows a stranger or there are enough. */
static int views_add_clip(struct views *v, struct views_report *r,
                          struct framesource *in, struct frame *f,
                          struct track *t, struct error *err)
{
    bool found = false;
    int rc = 1;

    for (; rc > 0 && !r->stranger && v->n < PERSON_MORE;
         rc = framesource_read(in, f, err)) {
        struct track_result now = {.lost = true};
        struct image im;

        rc = found ? track_step(t, &now, f, err)
                   : track_start(t, &now, f, NULL, err);
        if (rc < 0)
            break;
        now.lost = now.lost || !(found || rc);
        found = found || rc;
        if (now.lost || !views_is_new(v, now.motion.R))
            continue;
        if (frame_copy(&im, f, err) || views_take(v, r, &im, err) < 0)
            return -1;
    }
    if (rc == 0 && !found)
        return error_set(err, EX_DATAERR, "no face in this clip");
    return rc < 0 ? -1 : 0;
}

/* The file, whose first frame is f. */
static int views_add_frames(struct views *v, struct views_report *r,
                            struct framesource *in, struct frame *f,
                            const char *path, struct error *err)
{
    struct track_options opt = v->opt;
    struct track t = {0};
    struct image im;

    if (framesource_total(in) == 1)     /* as it is, with its own matte */
        return image_read(&im, path, err) || views_take(v, r, &im, err) < 0
                   ? -1 : 0;
    opt.no_align = true;
    const int rc = track_init(&t, &v->mean, &v->nets->motion, &opt, err) ||
                   views_add_clip(v, r, in, f, &t, err) ? -1 : 0;
    track_release(&t);
    return rc;
}

int views_add(struct views *v, struct views_report *r, const char *path,
              struct error *err)
{
    const struct framesource_options opt = {0};
    struct framesource *in;
    struct frame f;

    memset(r, 0, sizeof *r);
    if (video_is_live(path))
        return error_set(err, EX_USAGE, "%s: it has no end (expected a picture "
                         "or a clip)", path);
    in = framesource_open(&path, 1, &opt, err);
    if (!in)
        return -1;
    int rc = framesource_read(in, &f, err);
    if (rc == 0)
        error_set(err, EX_DATAERR, "%s: no frames", path);
    if (rc == 1) {
        rc = views_add_frames(v, r, in, &f, path, err) ? -1 : 1;
        if (rc < 0 && !strstr(err->text, path))
            error_prefix(err, "%s", path);
    }
    framesource_close(in);
    return rc == 1 ? 0 : -1;
}

/* ---- one identity ------------------------------------------------------------- */

/* What more pictures say of the same. */
enum views_part { VIEWS_SHAPE, VIEWS_EXPRESSION, VIEWS_JAW, VIEWS_LID };

static float *views_numbers(struct person *p, enum views_part part)
{
    float *const of[] = {p->shape, p->calm.exp, p->calm.pose.jaw,
                         p->calm.pose.lid};

    return of[part];
}

/* n numbers of the first picture become the mean over all, by how sure E_m is of
 * each. */
static void views_mean(struct person *first, struct views *v, size_t n,
                       enum views_part part)
{
    float *out = views_numbers(first, part);

    for (size_t i = 0; i < n; i++) {
        double total = (double)v->first->confidence;
        double sum = total * (double)out[i];

        for (size_t k = 0; k < v->n; k++) {
            struct source *s = v->source + k;
            const double confidence = (double)s->confidence;

            sum += confidence * (double)views_numbers(&s->person, part)[i];
            total += confidence;
        }
        out[i] = (float)(sum / fmax(total, 1e-12));
    }
}

int views_join(struct views *v, struct source *first, const struct image *im,
               const struct image *mask, struct error *err)
{
    struct person *p = &first->person;
    const size_t shape = p->nshape * sizeof *p->shape;

    if (!v->n)
        return source_cut_out(first, im, mask, v->head, v->nets, err);
    p->more = calloc(v->n, sizeof *p->more);
    if (!p->more) {
        source_release(first);
        return error_set(err, EX_OSERR, "no memory for %zu pictures", v->n);
    }
    views_mean(p, v, p->nshape, VIEWS_SHAPE);
    views_mean(p, v, v->head->nexp, VIEWS_EXPRESSION);
    views_mean(p, v, 3, VIEWS_JAW);
    views_mean(p, v, 2, VIEWS_LID);
    for (size_t k = 0; k < v->n; k++) {
        struct source *s = v->source + k;

        memcpy(s->person.shape, p->shape, shape);
        if (source_cut_out(s, v->image + k, NULL, v->head, v->nets, err)) {
            source_release(first);
            return -1;
        }
    }
    if (source_cut_out(first, im, mask, v->head, v->nets, err))
        return -1;
    views_mean(p, v, p->nshape, VIEWS_SHAPE);
    for (size_t k = 0; k < v->n; k++)
        p->more[p->nmore++] = source_move_person(v->source + k);
    return 0;
}
