/* The truth of plain figures: masks against the projected mesh, landmarks
 * against a double-precision projection, the mouth's inside seen between the
 * inner lips alone, the same bytes for any number of threads, and a head that
 * is another's refused. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/parallel.h"
#include "lib/lab/people/scan.h"
#include "lib/lab/people/scan_scene.h"
#include "lib/lab/people/synth.h"
#include "tests/check.h"
#include "tests/unit/camera_double.h"

enum { S = 192 };
#define CLEAR (-0.2f)           /* above it nothing turns with the shoulders */

/* Samples of a pixel, 8 x 8, that the mesh above floor_y covers: plain point
 * in triangle. */
static void cover_mesh(int *cover, const struct head *h, const double *uv,
                       float floor_y)
{
    static unsigned char hit[8 * S][8 * S];

    memset(hit, 0, sizeof hit);
    for (size_t f = 0; f < h->F; f++) {
        const double *p[3];
        double lo[2] = {1e9, 1e9}, hi[2] = {-1e9, -1e9};
        if (h->v_template[3 * h->f[3 * f] + 1] < floor_y)
            continue;
        for (int k = 0; k < 3; k++) {
            p[k] = uv + 2 * h->f[3 * f + k];
            for (int c = 0; c < 2; c++) {
                lo[c] = fmin(lo[c], p[k][c]);
                hi[c] = fmax(hi[c], p[k][c]);
            }
        }
        for (int y = (int)floor(lo[1] * 8); y <= (int)ceil(hi[1] * 8); y++)
            for (int x = (int)floor(lo[0] * 8); x <= (int)ceil(hi[0] * 8);
                 x++) {
                double px = (x + 0.5) / 8, py = (y + 0.5) / 8;
                int pos = 0, neg = 0;
                if (x < 0 || y < 0 || x >= 8 * S || y >= 8 * S)
                    continue;
                for (int k = 0; k < 3; k++) {
                    const double *a = p[k], *b = p[(k + 1) % 3];
                    double e = (b[0] - a[0]) * (py - a[1])
                               - (b[1] - a[1]) * (px - a[0]);
                    pos += e >= 0;
                    neg += e <= 0;
                }
                if (pos == 3 || neg == 3)
                    hit[y][x] = 1;
            }
    }
    for (int i = 0; i < S * S; i++) {
        cover[i] = 0;
        for (int k = 0; k < 64; k++)
            cover[i] += hit[i / S * 8 + k / 8][i % S * 8 + k % 8];
    }
}

/* The largest of cover within one pixel of i, or the smallest. */
static int truth_around(const int *cover, int i, int largest)
{
    int best = cover[i];

    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            int x = i % S + dx, y = i / S + dy;
            if (x < 0 || y < 0 || x >= S || y >= S)
                continue;
            int c = cover[y * S + x];
            best = largest ? (c > best ? c : best) : (c < best ? c : best);
        }
    return best;
}

/* One frame of a person, and where the head's vertices lie in double
 * precision. */
struct shot {
    struct scan_scene scene;
    struct motion m;
    float lmk[68][2];
    double *x, *uv;             /* (V,3), (V,2) */
    double cam[12];
};

static void truth_shoot(struct shot *o, struct scan_worker *w,
                        const struct scan_assets *a, const struct head *h,
                        uint64_t seed, uint64_t who, double time)
{
    static uint8_t rgb[3 * S * S], person[3 * S * S], mask[S * S],
        label[S * S];
    const struct scan_print out = {rgb, person, mask, label};
    struct error err = {0};

    o->x = malloc(3 * h->V * sizeof *o->x);
    o->uv = malloc(2 * h->V * sizeof *o->uv);
    REQUIRE(o->x && o->uv
            && !scan_scene_init(&o->scene, a, h, seed, who, 0, S, &err)
            && !scan_scene_render(&out, &o->m, o->lmk, NULL, w, &o->scene, 0,
                                  time, NULL, &err), "%s", err.text);
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++)
            o->cam[4 * k + c] = (double)o->m.R[3 * k + c];
        o->cam[4 * k + 3] = (double)o->m.t[k];
    }
    for (size_t i = 0; i < 3 * h->V; i++)
        o->x[i] = (double)w->verts[i];
    camera_project_d(o->uv, NULL, o->cam, S, o->x, h->V);
}

static void truth_release(struct shot *o)
{
    scan_scene_release(&o->scene);
    free(o->x);
    free(o->uv);
}

/* What is drawn of the head above the neck is the mesh, and the landmarks lie
 * where double precision puts them. */
static void check_mask(struct scan_worker *w, const struct scan_assets *a,
                       const struct head *h, int index)
{
    static int cover[S * S], all[S * S];
    struct shot o;
    int missing = 0, extra = 0, inside = 0;
    double worst = 0, lmk[68 * 3], at[68 * 2];

    truth_shoot(&o, w, a, h, 5, (uint64_t)index, 3.0 * index);
    cover_mesh(cover, h, o.uv, CLEAR);
    cover_mesh(all, h, o.uv, -9);
    for (int i = 0; i < S * S; i++) {
        uint8_t tag = w->stage.tag[i];

        inside += cover[i] == 64;
        missing += truth_around(cover, i, 0) == 64 && w->stage.alpha[i] < 1;
        extra += (tag == LABEL_NOSE || tag == LABEL_LIP || tag == LABEL_EYE)
                 && truth_around(all, i, 1) == 0;
    }
    printf("person %d: %d pixels of mesh, %d not in the mask, %d of face "
           "beyond a pixel outside\n", index, inside, missing, extra);
    check_that("mask is the projected mesh",
               inside > 2000 && !missing && !extra);
    for (int k = 0; k < 68; k++)
        for (int c = 0; c < 3; c++) {
            lmk[3 * k + c] = 0;
            for (int j = 0; j < 3; j++)
                lmk[3 * k + c] += (double)h->landmark_bary[3 * k + j]
                    * o.x[3 * h->f[3 * h->landmark_faces[k] + j] + c];
        }
    camera_project_d(at, NULL, o.cam, S, lmk, 68);
    for (int k = 0; k < 68; k++)
        worst = fmax(worst, hypot(at[2 * k] - (double)o.lmk[k][0],
                                  at[2 * k + 1] - (double)o.lmk[k][1]));
    check("landmarks, pixels", worst, 0.01);
    truth_release(&o);
}

/* ---- the inside of the mouth -------------------------------------------- */

/* Distance of (x,y) from the polygon uv (n,2), 0 inside. */
static double truth_outside(const double *uv, size_t n, double x, double y)
{
    double best = 1e9;
    bool in = false;

    for (size_t i = 0, j = n - 1; i < n; j = i++) {
        const double *a = uv + 2 * j, *b = uv + 2 * i;
        double e[2] = {b[0] - a[0], b[1] - a[1]};
        double t = ((x - a[0]) * e[0] + (y - a[1]) * e[1])
                   / (e[0] * e[0] + e[1] * e[1] + 1e-12);

        t = fmin(fmax(t, 0), 1);
        best = fmin(best, hypot(a[0] + t * e[0] - x, a[1] + t * e[1] - y));
        if ((a[1] > y) != (b[1] > y)
            && x < a[0] + (y - a[1]) / (b[1] - a[1]) * e[0])
            in = !in;
    }
    return in ? 0 : best;
}

/* Samples of the mouth's inside in all, and how far outside the inner lips'
 * ring the farthest lies, pixels. */
static size_t truth_mouth_frame(double *worst, const struct scan_stage *s,
                                const struct shot *o, const struct head *h)
{
    double uv[2 * 64];
    size_t n = h->nlip_inner, seen = 0;

    REQUIRE(n <= 64, "%zu inner lip vertices (expected 64 at most)", n);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 2; k++)
            uv[2 * i + k] = o->uv[2 * h->lip_inner[i] + (int)k] * SCAN_GRID;
    for (int i = 0; i < s->grid * s->grid; i++) {
        if (s->label[i] != LABEL_MOUTH && s->label[i] != LABEL_TEETH)
            continue;
        seen++;
        *worst = fmax(*worst, truth_outside(uv, n, i % s->grid + 0.5,
                                            i / s->grid + 0.5) / SCAN_GRID);
    }
    return seen;
}

static void check_mouth(struct scan_worker *w, const struct scan_assets *a,
                        const struct head *h)
{
    double worst = 0;
    size_t seen = 0;

    for (uint64_t who = 0; who < 24; who++) {
        struct shot o;

        truth_shoot(&o, w, a, h, 21, who, 1.7 * (double)who);
        seen += truth_mouth_frame(&worst, &w->stage, &o, h);
        truth_release(&o);
    }
    printf("mouths: %zu samples seen\n", seen);
    check_that("mouths are looked into", seen > 2000);
    check("the mouth's inside beyond the inner lips, pixels", worst, 2);
}

/* ---- runs --------------------------------------------------------------- */

/* FNV of everything that frames say. */
static uint64_t truth_run(const struct head *h, int threads)
{
    struct synth_options opt = {.seed = 9, .people = 3, .frames = 4,
                                .size = 64, .fps = 2, .effects = 1,
                                .mesh = true};
    struct error err = {0};
    struct synth_frame f;
    parallel_set_width(threads);
    struct synth *s = synth_open(h, &opt, &err);
    uint64_t hash = 0xcbf29ce484222325u;
    int rc;

    while ((rc = s ? synth_next(s, &f, &err) : -1) > 0) {
        struct motion m;
        const void *part[] = {f.rgb, f.mask, f.label, f.verts, &m, f.lmk,
                              f.beta, f.alone};
        size_t size[] = {64 * 64 * 3, 64 * 64, 64 * 64, 12 * h->V,
                         sizeof m, 68 * 8, 4 * f.nbeta, 64 * 64 * 3};
        memcpy(&m, f.motion, sizeof m);
        m.pose.exp = NULL;      /* its own place */
        for (int k = 0; k < 8; k++)
            for (size_t i = 0; i < size[k]; i++)
                hash = (hash ^ ((const uint8_t *)part[k])[i])
                       * 0x100000001b3u;
    }
    check_that("a run of 12 frames", rc == 0);
    synth_close(s);
    return hash;
}

/* A head without ARKit's expressions is none of a figure's. */
static void check_other_head(const struct head *h)
{
    struct head other = *h;
    struct error err = {0};

    other.nexp = 10;
    check_that("a head without the scans' expressions is refused",
               !scan_plain_open(NULL, &other, &err)
               && strstr(err.text, "the scans' shapes"));
}

int main(void)
{
    struct error err = {0};
    struct head h;
    struct scan_worker w;

    REQUIRE(!head_load(&h, "examples/model/head.safetensors", &err), "%s",
            err.text);
    struct scan_assets *a = scan_plain_open(NULL, &h, &err);
    REQUIRE(a && !scan_worker_init(&w, &h, S, &err), "%s", err.text);
    for (int i = 0; i < 4; i++)
        check_mask(&w, a, &h, i);
    check_mouth(&w, a, &h);
    scan_worker_release(&w);
    scan_close(a);
    uint64_t one = truth_run(&h, 1);
    check_that("two runs, the same bytes", one == truth_run(&h, 1));
    check_that("three threads, the same bytes", one == truth_run(&h, 3));
    check_other_head(&h);
    head_release(&h);
    return check_status();
}
