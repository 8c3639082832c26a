/* The people's truth: masks against the projected mesh, landmarks against a
 * double-precision projection, the same bytes for any number of threads, and
 * the same light from the shaders of every instruction set. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "lib/base/cpu.h"
#include "lib/base/isa.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/lab/people/lens.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/stage.h"
#include "lib/lab/people/synth.h"
#include "tests/check.h"

enum { S = 192 };

static int open_head(struct head *h)
{
    struct error err = {0};
    int rc = head_load(h, "examples/model/head.safetensors", &err);

    if (rc)
        printf("FAILED: head: %s\n", err.text);
    return rc;
}

/* Samples of a pixel, 8 x 8, that the mesh covers: plain point in triangle. */
static void cover_mesh(int *cover, const struct head *h, const double *uv)
{
    static unsigned char hit[8 * S][8 * S];

    memset(hit, 0, sizeof hit);
    for (size_t f = 0; f < h->F; f++) {
        const double *p[3];
        double lo[2] = {1e9, 1e9}, hi[2] = {-1e9, -1e9};
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

/* Most of cover within one pixel of i, or least. */
static int truth_around(const int *cover, int i, int most)
{
    int best = cover[i];

    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            int x = i % S + dx, y = i / S + dy;
            if (x < 0 || y < 0 || x >= S || y >= S)
                continue;
            int c = cover[y * S + x];
            best = most ? (c > best ? c : best) : (c < best ? c : best);
        }
    return best;
}

/* Whether a sample of pixel i shows the head model. */
static int shows_head(const struct stage *s, const struct head *h, int i)
{
    for (int k = 0; k < STAGE_GRID * STAGE_GRID; k++) {
        int x = i % S * STAGE_GRID + k % STAGE_GRID;
        int y = i / S * STAGE_GRID + k / STAGE_GRID;
        if (s->eye.id[y * s->eye.w + x] < h->F)
            return 1;
    }
    return 0;
}

/* A bald head whose shoulders turn with it: what is drawn of the head is the
 * mesh, and the landmarks lie where double precision puts them. */
static void check_mask(const struct head *h, int index)
{
    static int cover[S * S];
    struct persona p;
    struct actor a;
    struct stage s;
    struct synth_motion m;
    struct error err = {0};
    int missing = 0, extra = 0, inside = 0;
    double worst = 0, cam[12], *x = malloc(3 * h->V * sizeof *x);
    double *uv = malloc(2 * h->V * sizeof *uv), lmk[68 * 3], at[68 * 2];

    persona_sample(&p, 5, (uint64_t)index, h->nshape, 0);
    p.hair.style = HAIR_SHAVED;
    p.glasses = 0;
    p.beard_length = 0;
    if (!x || !uv || actor_init(&a, h, &p, &err)
        || stage_init(&s, S, &err)) {
        check_that(err.text, 0);
        return;
    }
    synth_motion(&m, &p, 3.0 * index, h->nexp, NULL);
    memcpy(m.body, m.rot, sizeof m.body);
    memcpy(m.body_trans, m.trans, sizeof m.body_trans);
    check_that("rendered", !stage_render(&s, &a, &m, &err));
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++)
            cam[4 * k + c] = (double)m.rot[3 * k + c];
        cam[4 * k + 3] = (double)m.trans[k];
    }
    for (size_t i = 0; i < 3 * h->V; i++)
        x[i] = (double)s.verts[i];
    camera_project_d(uv, NULL, cam, S, x, h->V);
    cover_mesh(cover, h, uv);
    for (int i = 0; i < S * S; i++) {
        inside += cover[i] == 64;
        if (truth_around(cover, i, 0) == 64 && s.cover[i] < 1)
            missing++;
        if (truth_around(cover, i, 1) == 0 && shows_head(&s, h, i))
            extra++;
    }
    printf("person %d: %d pixels of mesh, %d not in the mask, %d beyond a "
           "pixel outside\n", index, inside, missing, extra);
    check_that("mask is the projected mesh",
               inside > 2000 && !missing && !extra);
    for (int k = 0; k < 68; k++)
        for (int c = 0; c < 3; c++) {
            lmk[3 * k + c] = 0;
            for (int j = 0; j < 3; j++)
                lmk[3 * k + c] += (double)h->landmark_bary[3 * k + j]
                    * x[3 * h->f[3 * h->landmark_faces[k] + j] + c];
        }
    camera_project_d(at, NULL, cam, S, lmk, 68);
    for (int k = 0; k < 68; k++)
        worst = fmax(worst, hypot(at[2 * k] - (double)s.lmk[k][0],
                                  at[2 * k + 1] - (double)s.lmk[k][1]));
    printf("landmarks: largest error %.2g pixels (limit 0.5)\n", worst);
    check_that("landmarks", worst < 0.5);
    stage_release(&s);
    actor_release(&a);
    free(x);
    free(uv);
}

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
        const void *part[] = {f.rgb, f.mask, f.label, f.verts, f.motion,
                              f.lmk, f.beta};
        size_t size[] = {64 * 64 * 3, 64 * 64, 64 * 64, 12 * h->V,
                         sizeof *f.motion, 68 * 8, 4 * f.nbeta};
        for (int k = 0; k < 7; k++)
            for (size_t i = 0; i < size[k]; i++)
                hash = (hash ^ ((const uint8_t *)part[k])[i])
                       * 0x100000001b3u;
    }
    check_that("a run of 12 frames", rc == 0);
    synth_close(s);
    return hash;
}

#ifdef SPID_X86
shade_skin_fn shade_skin_baseline, shade_skin_avx2, shade_skin_avx512;
shade_eye_fn shade_eye_baseline, shade_eye_avx2, shade_eye_avx512;
shade_cloth_fn shade_cloth_baseline, shade_cloth_avx2, shade_cloth_avx512;
shade_strand_fn shade_strand_baseline, shade_strand_avx2, shade_strand_avx512;

static void random_block(struct shade_block *b, struct random *r)
{
    float *x = (float *)b;

    for (size_t i = 0; i < sizeof *b / sizeof *x; i++)
        x[i] = (float)random_range(r, 0, 1);
    for (int i = 0; i < SHADE_N; i++)
        for (int k = 0; k < 3; k++) {
            b->p[k][i] = (float)random_range(r, -1, 1) + (k == 2 ? 12 : 0);
            b->n[k][i] = (float)random_range(r, -1, 1);
            b->c[k][i] = (float)random_range(r, -1, 1);
        }
}

/* Every shader of every set on the same blocks: equal bits. */
static void check_shaders(void)
{
    static float map[64 * 64];
    struct persona p;
    struct shade_block in, out[3];
    struct random r;
    struct shade_strand strand = {.base = {.2f, .1f, .05f}, .spread = .3f,
                                  .gloss = 1, .tint = 1, .soft = .1f};
    struct shade_kernels set[3] = {
        {shade_skin_baseline, shade_eye_baseline, shade_cloth_baseline,
         shade_strand_baseline},
        {shade_skin_avx2, shade_eye_avx2, shade_cloth_avx2,
         shade_strand_avx2},
        {shade_skin_avx512, shade_eye_avx512, shade_cloth_avx512,
         shade_strand_avx512}};
    int same = 1;

    persona_sample(&p, 1, 1, 300, 1);
    random_init(&r, 4, "blocks");
    for (int i = 0; i < 64 * 64; i++)
        map[i] = (float)random_range(&r, 1, 1e4);
    p.env.shadow = (struct shade_shadow){.map = map, .n = 64, .sharp = 20,
        .sun = {.u = {1, 0, 0}, .v = {0, 1, 0}, .w = {0, 0, -1},
                .centre = {0, 0, 12}, .scale = 20, .half = 32}};
    for (int n = 0; n < 40; n++) {
        random_block(&in, &r);
        for (int k = 0; k <= (int)cpu_level(); k++) {
            out[k] = in;
            switch (n % 4) {
            case 0: set[k].skin(&out[k], &p.env, &p.skin); break;
            case 1: set[k].eye(&out[k], &p.env, &p.eye); break;
            case 2: set[k].cloth(&out[k], &p.env, &p.cloth); break;
            default: set[k].strand(&out[k], &p.env, &strand);
            }
            same &= !memcmp(out[k].rgb, out[0].rgb, sizeof in.rgb);
        }
        for (int i = 0; i < SHADE_N; i++)
            same &= isfinite(out[0].rgb[0][i]) != 0;
    }
    printf("shaders: 40 blocks on %s\n", cpu_level_name(cpu_level()));
    check_that("every instruction set gives the same bits", same);
}
#endif

int main(void)
{
    struct head h;

    if (open_head(&h))
        return 1;
    noise_lattice();
    lens_init();
    for (int i = 0; i < 4; i++)
        check_mask(&h, i);
    uint64_t one = truth_run(&h, 1);
    check_that("two runs, the same bytes", one == truth_run(&h, 1));
    check_that("three threads, the same bytes", one == truth_run(&h, 3));
#ifdef SPID_X86
    check_shaders();
#endif
    head_release(&h);
    return check_status();
}
