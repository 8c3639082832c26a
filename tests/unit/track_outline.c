/* The outline's fit on mattes that are exact: silhouettes of the shipped head
 * with shapes that are known. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/photo/outline.h"
#include "lib/photo/overlay.h"
#include "tests/check.h"

#define HEAD_NAME "examples/model/head.safetensors"
#define SIZE 512
#define SHAPES 30               /* numbers of the true shape */
#define INNER 17                /* landmarks from here on stay */

/* A frontal head, 12 units away. */
static void outline_person(struct person *p, const struct head *h)
{
    static const float front[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};

    memset(p, 0, sizeof *p);
    p->nshape = h->nshape;
    p->shape = calloc(h->nshape, sizeof *p->shape);
    p->size = SIZE;
    p->rgb = malloc(3 * SIZE * SIZE);
    p->matte = malloc(SIZE * SIZE);
    p->has_source = true;
    memcpy(p->source.R, front, sizeof front);
    p->source.t[2] = 12;
    p->source.pose.exp = p->source.exp;
    REQUIRE(p->shape && p->rgb && p->matte, "no memory");
    memset(p->rgb, 128, 3 * SIZE * SIZE);
}

/* The head with a shape: its silhouette (SIZE,SIZE) where asked for, and its
 * landmarks in the picture. */
static void outline_draw(float uv[2 * HEAD_LANDMARKS], uint8_t *silhouette,
                         const struct person *p, const struct head *h,
                         const float *shape)
{
    float *verts = malloc(3 * h->V * sizeof *verts), cam[12];
    float lmk[3 * HEAD_LANDMARKS];
    struct identity id = {0};
    struct overlay o = {0};
    struct error err = {0};

    REQUIRE(verts && head_fold(&id, h, shape, h->nshape, &err) == 0 &&
            overlay_init(&o, &id, &err) == 0, "%s", err.text);
    if (silhouette)
        overlay_silhouette(silhouette, &o, &p->source, SIZE);
    head_pose(verts, &id, &p->source.pose);
    head_landmarks(lmk, h, verts);
    motion_camera(cam, &p->source);
    camera_project(uv, NULL, cam, SIZE, lmk, HEAD_LANDMARKS);
    overlay_release(&o);
    identity_release(&id);
    free(verts);
}

/* Mean distance of landmarks first to last - 1, pixels. */
static double outline_apart(const float *a, const float *b, size_t first,
                            size_t last)
{
    double sum = 0;

    for (size_t l = first; l < last; l++)
        sum += hypot((double)a[2 * l] - b[2 * l],
                     (double)a[2 * l + 1] - b[2 * l + 1]);
    return sum / (double)(last - first);
}

static struct outline_report outline_fitted(struct person *p,
                                            const struct head *h)
{
    struct outline_report r;
    struct error err = {0};

    CHECK(outline_fit(&r, p, h, &err) == 0, "%s", err.text);
    return r;
}

/* Shapes drawn at random, found again by their outlines. */
static void test_shapes(const struct head *h)
{
    float *shape = calloc(h->nshape, sizeof *shape);
    float mean[2 * HEAD_LANDMARKS], found[2 * HEAD_LANDMARKS];
    double before = 0, after = 0, moved = 0;
    struct random rand;
    struct person p;

    REQUIRE(shape, "no memory");
    random_init(&rand, 5, "outline");
    outline_person(&p, h);
    for (int person = 0; person < 4; person++) {
        for (size_t k = 0; k < SHAPES; k++)
            shape[k] = (float)random_normal(&rand);
        outline_draw(found, p.matte, &p, h, shape);
        memset(p.shape, 0, p.nshape * sizeof *p.shape);
        outline_draw(mean, NULL, &p, h, p.shape);
        const struct outline_report r = outline_fitted(&p, h);
        CHECK(r.points >= 40, "%zu points of the rim", r.points);
        outline_draw(found, NULL, &p, h, p.shape);
        before += r.before / 4;
        after += r.after / 4;
        moved += outline_apart(mean, found, INNER, HEAD_LANDMARKS) / 4;
    }
    check_range("the mean head's rim, pixels off", before, 1.5, 20);
    check("once fitted", after, 1);
    check("landmarks that stay: moved by pixels", moved, 1.5);
    free(shape);
    person_release(&p);
}

/* How many pixels of the person's head lie outside the matte. */
static size_t outline_beyond(const struct person *p, const struct head *h)
{
    uint8_t *head = malloc(SIZE * SIZE);
    float uv[2 * HEAD_LANDMARKS];
    size_t n = 0;

    REQUIRE(head, "no memory");
    outline_draw(uv, head, p, h, p->shape);
    for (size_t i = 0; i < SIZE * SIZE; i++)
        n += head[i] > 127 && p->matte[i] < 128;
    free(head);
    return n;
}

/* A skull smaller than the mean's under a cap as tight, of another colour than
 * skin, pulls the head in. */
static void test_cap(const struct head *h)
{
    float *shape = calloc(h->nshape, sizeof *shape);
    float small[2 * HEAD_LANDMARKS];
    struct person p;

    REQUIRE(shape, "no memory");
    outline_person(&p, h);
    shape[0] = 1.5f;
    outline_draw(small, p.matte, &p, h, shape);
    memset(p.rgb, 0, 3 * SIZE * SIZE * 2 / 5);
    const size_t before = outline_beyond(&p, h);
    outline_fitted(&p, h);
    const size_t after = outline_beyond(&p, h);
    check_that("the mean head reaches beyond a small one", before > 500);
    check("of which once fitted is left, share",
          (double)after / (double)before, 0.2);
    free(shape);
    person_release(&p);
}

/* Hair about the head changes little of what is found without. */
static void test_hair(const struct head *h)
{
    float *bare = calloc(h->nshape, sizeof *bare);
    float mean[2 * HEAD_LANDMARKS];
    struct person p;
    double moved = 0;

    REQUIRE(bare, "no memory");
    outline_person(&p, h);
    outline_draw(mean, p.matte, &p, h, p.shape);
    outline_fitted(&p, h);
    memcpy(bare, p.shape, h->nshape * sizeof *bare);
    memset(p.shape, 0, h->nshape * sizeof *p.shape);
    for (size_t i = 0; i < SIZE * SIZE / 3; i++)
        if (hypot((double)(i % SIZE) - SIZE / 2,
                  (double)(i / SIZE) - SIZE / 2) < 0.42 * SIZE)
            p.matte[i] = 255;
    outline_fitted(&p, h);
    for (size_t k = 0; k < p.nshape; k++)
        moved = fmax(moved, fabs((double)p.shape[k] - bare[k]));
    check("hair changes the shape by deviations", moved, 0.2);
    free(bare);
    person_release(&p);
}

/* Nothing to see: the shape stays. */
static void test_nothing(const struct head *h)
{
    struct outline_report r;
    struct person p;
    float sum = 0;

    outline_person(&p, h);
    memset(p.matte, 255, SIZE * SIZE);
    r = outline_fitted(&p, h);
    for (size_t k = 0; k < p.nshape; k++)
        sum += fabsf(p.shape[k]);
    check_that("a matte without an edge leaves the shape",
               r.points == 0 && sum == 0);
    for (size_t i = 0; i < SIZE * SIZE; i++)    /* hair, far outside */
        p.matte[i] = i % SIZE < 20 || i % SIZE >= SIZE - 20 ? 0 : 255;
    r = outline_fitted(&p, h);
    for (size_t k = 0; k < p.nshape; k++)
        sum += fabsf(p.shape[k]);
    check_that("and so does an edge that is far", r.points == 0 && sum == 0);
    person_release(&p);
}

int main(void)
{
    struct head h;
    struct error err = {0};

    REQUIRE(head_load(&h, HEAD_NAME, &err) == 0, "%s", err.text);
    test_shapes(&h);
    test_cap(&h);
    test_hair(&h);
    test_nothing(&h);
    head_release(&h);
    return check_status();
}
