/* A small head and a small stream of people, for tests of lib/lab/train. */
#ifndef SPID_TESTS_TRAIN_TOY_H
#define SPID_TESTS_TRAIN_TOY_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"
#include "lib/stream/stream.h"
#include "lib/lab/head/avatar_make.h"
#include "tests/unit/shipped_mouth.h"

/* A globe of 10 x 12 vertices with random directions; nshape directions of
 * shape, 100 of expression. */
static void toy_head(struct head *h, size_t nshape)
{
    enum { RINGS = 10, SIDES = 12, V = RINGS * SIDES, E = 100 };
    size_t F = 2 * (RINGS - 1) * SIDES, D = nshape + E;
    float *v = calloc(3 * V, 4), *dirs = calloc(3 * V * D, 4);
    float *pose = calloc(3 * V * 36, 4), *reg = calloc(5 * V, 4);
    float *w = calloc(5 * V, 4), *lid = calloc(6 * V, 4), *bary = NULL;
    int32_t *f = calloc(3 * F, 4), parents[5] = {-1, 0, 1, 1, 1}, lf[68];
    int32_t ring[SIDES], lip[4] = {60, 61, 62, 63};
    struct random r;
    struct error err = {0};

    random_init(&r, 1, "toy head");
    for (size_t i = 0; i < V; i++) {
        double a = (0.5 + (double)(i / SIDES)) / RINGS * 3.14159;
        double b = (double)(i % SIDES) / SIDES * 6.28318;
        v[3 * i] = (float)(0.1 * sin(a) * sin(b));
        v[3 * i + 1] = (float)(0.13 * cos(a));
        v[3 * i + 2] = (float)(0.1 * sin(a) * cos(b));
        for (size_t j = 0; j < 5; j++)
            w[5 * i + j] = 0.2f;
    }
    for (size_t i = 0; i < 3 * V * D; i++)
        dirs[i] = (float)(0.001 * random_normal(&r));
    for (size_t i = 0; i < 3 * V * 36; i++)
        pose[i] = (float)(0.001 * random_normal(&r));
    for (size_t i = 0; i < 6 * V; i++)
        lid[i] = (float)(0.003 * random_normal(&r));
    for (size_t j = 0; j < 5; j++)
        for (size_t k = 0; k < 4; k++)
            reg[j * V + (17 * j + 5 * k) % V] += 0.25f;
    for (size_t i = 0, k = 0; i + 1 < RINGS; i++)
        for (size_t s = 0; s < SIDES; s++, k += 6) {
            int32_t a = (int32_t)(i * SIDES + s);
            int32_t b = (int32_t)(i * SIDES + (s + 1) % SIDES);
            int32_t t[6] = {a, a + SIDES, b, b, a + SIDES, b + SIDES};
            memcpy(f + k, t, sizeof t);
        }
    bary = calloc(3 * 68, 4);
    for (int i = 0; i < 68; i++) {
        lf[i] = (int32_t)((size_t)i * 3 % F);
        bary[3 * i] = 0.5f;
        bary[3 * i + 1] = 0.25f;
        bary[3 * i + 2] = 0.25f;
    }
    for (int i = 0; i < SIDES; i++)
        ring[i] = 60 + i;
    struct head_arrays a = {
        .V = V, .F = F, .nshape = nshape, .nexp = E, .v_template = v, .f = f,
        .shapedirs = dirs, .posedirs = pose, .J_regressor = reg,
        .weights = w, .parents = parents, .l_eyelid = lid,
        .r_eyelid = lid + 3 * V, .lip_inner = ring, .nlip_inner = SIDES,
        .lip_upper_outer = lip, .nlip_upper_outer = 4, .landmark_faces = lf,
        .landmark_bary = bary};
    if (head_init(h, &a, &err) || avatar_make(h, shipped_mouth(), &err)) {
        fprintf(stderr, "toy head: %s\n", err.text);
        exit(1);
    }
    free(v), free(dirs), free(pose), free(reg), free(w), free(lid);
    free(bary), free(f);
}

/* A motion of frame k of person p, and its landmarks in a picture of S. */
struct toy_frame {
    float rot[9], trans[3], exp[100], jaw[3], lid[2], eye[6], lmk[136];
};

static void toy_motion(struct toy_frame *t, const struct head *h,
                       const struct identity *id, size_t p, size_t k,
                       size_t S)
{
    struct random r;
    struct head_motion m = {.exp = t->exp};
    float q[3], turn[9], x[68 * 3], cam[12];
    float *verts = malloc(3 * h->V * sizeof *verts);
    static const float front[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};

    random_init(&r, 100 * p + k, "toy motion");
    for (int i = 0; i < 3; i++)
        q[i] = (float)random_range(&r, -0.3, 0.3);
    rotation_exp(turn, q);
    mat3_mul(t->rot, front, turn);
    t->trans[0] = (float)random_range(&r, -0.05, 0.05);
    t->trans[1] = (float)random_range(&r, -0.05, 0.05);
    t->trans[2] = (float)random_range(&r, 11, 13);
    for (int i = 0; i < 100; i++)
        t->exp[i] = (float)(0.5 * random_normal(&r));
    memset(t->jaw, 0, sizeof t->jaw);
    t->jaw[0] = m.jaw[0] = (float)random_range(&r, 0, 0.4);
    for (int i = 0; i < 2; i++)
        t->lid[i] = m.lid[i] = (float)random_uniform(&r);
    for (int i = 0; i < 6; i++)
        t->eye[i] = m.eye[i] = (float)random_range(&r, -0.2, 0.2);
    head_pose(verts, id, &m);
    head_landmarks(x, h, verts);
    camera_make(cam, t->rot, t->trans);
    camera_project(t->lmk, NULL, cam, (float)S, x, 68);
    free(verts);
}

/* Blobs at the landmarks on black. */
static void toy_picture(uint8_t *rgb, uint8_t *mask, size_t S,
                        const float *lmk, size_t person)
{
    memset(rgb, 0, 3 * S * S);
    memset(mask, 0, S * S);
    for (int i = 0; i < 68; i++)
        for (int d = 0; d < 25; d++) {
            long x = (long)lmk[2 * i] + d % 5 - 2;
            long y = (long)lmk[2 * i + 1] + d / 5 - 2;
            if (x < 0 || y < 0 || x >= (long)S || y >= (long)S)
                continue;
            uint8_t *o = rgb + 3 * ((size_t)y * S + (size_t)x);
            mask[(size_t)y * S + (size_t)x] = 255;
            o[0] = (uint8_t)(100 + 2 * i);
            o[1] = (uint8_t)(250 - 3 * i);
            o[2] = (uint8_t)(60 + 40 * (person % 4));
        }
}

static void toy_stream(const char *path, const struct head *h, size_t people,
                       size_t frames, size_t S)
{
    struct error err = {0};
    struct stream_writer *w = stream_create(path, &err);
    uint8_t *rgb = malloc(4 * S * S), *mask = rgb + 3 * S * S;
    uint64_t at = 0;

    for (size_t p = 0; w && p < people; p++) {
        float shape[300] = {0};
        int32_t number = (int32_t)p;
        struct random r;
        struct identity id = {0};
        random_init(&r, p, "toy shape");
        for (size_t i = 0; i < 300; i++)
            shape[i] = (float)random_normal(&r);
        struct array s[2] = {
            array_make("shape", DTYPE_F32, shape, 1, 300, 0, 0, 0),
            array_make("person", DTYPE_I32, &number, 1, 1, 0, 0, 0)};
        if (stream_write(w, "SHAP", at, 0, s, 2, &err) ||
            head_fold(&id, h, shape, h->nshape, &err))
            break;
        for (size_t k = 0; k < frames; k++, at++) {
            struct toy_frame t;
            toy_motion(&t, h, &id, p, k, S);
            toy_picture(rgb, mask, S, t.lmk, p);
            struct array m[7] = {
                array_make("rot", DTYPE_F32, t.rot, 2, 3, 3, 0, 0),
                array_make("trans", DTYPE_F32, t.trans, 1, 3, 0, 0, 0),
                array_make("exp", DTYPE_F32, t.exp, 1, 100, 0, 0, 0),
                array_make("jaw", DTYPE_F32, t.jaw, 1, 3, 0, 0, 0),
                array_make("lid", DTYPE_F32, t.lid, 1, 2, 0, 0, 0),
                array_make("eye", DTYPE_F32, t.eye, 1, 6, 0, 0, 0),
                array_make("lmk", DTYPE_F32, t.lmk, 2, 68, 2, 0, 0)};
            struct array i[2] = {
                array_make("rgb", DTYPE_U8, rgb, 3, S, S, 3, 0),
                array_make("mask", DTYPE_U8, mask, 2, S, S, 0, 0)};
            if (stream_write(w, "MOTN", at, 0, m, 7, &err) ||
                stream_write(w, "IMAG", at, 0, i, 2, &err))
                break;
        }
        identity_release(&id);
    }
    if (!w || err.code || stream_finish(w, &err)) {
        fprintf(stderr, "toy stream: %s\n", err.text);
        exit(1);
    }
    free(rgb);
}

#endif
