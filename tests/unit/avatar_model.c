/* A model file with untrained weights: written, read back, baked; the picture
 * must show the source already.  With arguments OUT, small or shipped, and a
 * head model it only writes the file, for the pipe tests. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "lib/avatar/baker.h"
#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/head/lbs.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/refiner.h"
#include "lib/net/shape_encoder.h"
#include "lib/splat/splat.h"
#include "lib/lab/head/avatar_make.h"
#include "tests/unit/shipped_mouth.h"
#include "tests/unit/sphere_head.h"

#define S 128

static void give_up(const struct error *err)
{
    printf("%s\n", err->text);
    exit(1);
}

static void model_configure(struct avatar_config *c, const char *kind)
{
    avatar_config_shipped(c);
    if (strcmp(kind, "small") == 0) {
        c->size = 128;
        c->plane = c->backbone.size = 64;
        c->mouth = 8;
        c->channels = c->refiner.channels = 8;
        c->feature = c->backbone.features = 8;
        c->backbone.width = 4;
        c->static_width = c->dynamic_width = c->mouth_width = 8;
        c->dynamic_hidden = c->vertex_width = c->init_width = 8;
        c->refiner.width = 16;
    }
}

/* A refiner that has learned nothing adds nothing, and what it receives of the
 * head's relative pose would go unnoticed. */
static void model_teach(struct params *ps)
{
    struct random r;

    random_init(&r, 3, "refiner");
    for (size_t t = 0; t < ps->count; t++) {
        const struct param *p = &ps->tensor[t];
        size_t n = strlen(p->name);

        if (strcmp(p->name, "refine.rgb.weight") &&
            (n < 5 || strcmp(p->name + n - 5, ".vary")))
            continue;
        for (size_t i = 0; i < p->count; i++)
            param_w(ps, t)[i] = 0.03f * (float)random_normal(&r);
    }
}

static void write_model(const char *path, const struct head *h,
                        const char *kind)
{
    struct avatar_config c;
    struct params ps;
    struct motion_encoder motion = {0};
    struct shape_encoder shape = {0};
    struct avatar a;
    struct refiner r = {0};
    struct error err = {0};

    model_configure(&c, kind);
    memcpy(c.head_hash, h->hash, sizeof c.head_hash);
    params_init(&ps);
    if (motion_encoder_init(&motion, &ps, "motion.", c.motion_net, &err) ||
        shape_encoder_init(&shape, &ps, "shape.", c.shape_net, &err) ||
        avatar_init(&a, &ps, &c, h, &err) ||
        refiner_init(&r, &ps, "refine.", &c.refiner, &err) ||
        params_allocate(&ps, &err))
        give_up(&err);
    params_randomise(&ps, 1);
    model_teach(&ps);
    motion_encoder_init_weights(&motion);
    avatar_init_weights(&a);
    char *json = avatar_config_print(&c);
    const char *meta[] = {"spid", json, NULL};
    if (params_save(&ps, path, meta, &err))
        give_up(&err);
    free(json);
    refiner_release(&r);
    avatar_release(&a);
    shape_encoder_release(&shape);
    motion_encoder_release(&motion);
    params_release(&ps);
}

/* A person in front of black: the sphere's disc in colours that vary slowly. */
static void model_paint(uint8_t *rgb, uint8_t *matte)
{
    for (size_t i = 0; i < S * S; i++) {
        double x = (double)(i % S) - S / 2.0, y = (double)i / S - S / 2.0;

        matte[i] = hypot(x, y) < 0.45 * S ? 255 : 0;
        for (size_t c = 0; c < 3; c++)
            rgb[3 * i + c] = matte[i] ? (uint8_t)(128 + 60 *
                             sin(0.05 * x + (double)c) * cos(0.04 * y)) : 0;
    }
}

/* PSNR of the untrained avatar, drawn as the source saw it, against it. */
static double model_likeness(struct baker *m, const float *verts)
{
    static uint8_t rgb[3 * S * S], matte[S * S];
    static float image[3 * S * S], alpha[S * S];
    struct splat_options so = splat_defaults(S, S, 3);
    struct splat_camera view;
    struct splat splat;
    struct error err = {0};
    float cam[12];
    double sum = 0;

    model_paint(rgb, matte);
    camera_frontal(cam, 12);
    avatar_bake(&m->avatar, &(struct avatar_source){
        .rgb = rgb, .matte = matte, .verts = verts, .cam = cam
    });
    view = splat_camera_square(cam, S, CAMERA_FOCAL);
    if (splat_init(&splat, &so, &err) ||
        splat_load(&splat, &m->avatar.set, &err) ||
        splat_draw(&splat,
                   &(struct splat_pictures){.image = image, .alpha = alpha},
                   &view, NULL, NULL, &err))
        give_up(&err);
    splat_release(&splat);
    for (size_t i = 0; i < 3 * S * S; i++)
        sum += pow(image[i] - rgb[i] / 255.0, 2);
    return -10 * log10(sum / (3.0 * S * S));
}

/* Rows of a float array with so many columns differ. */
static int model_differs(const float *a, size_t of_a, const float *b,
                         size_t of_b, size_t n)
{
    const size_t min = of_a < of_b ? of_a : of_b;
    int bad = 0;

    for (size_t i = 0; i < n; i++)
        bad |= memcmp(a + i * of_a, b + i * of_b, min * sizeof *a) != 0;
    return bad;
}

/* Three colours and what is drawn are those of a full bake, to the bit. */
static int model_part_test(struct baker *full, const struct model *model,
                           const struct head *h, const float *verts)
{
    const struct baker_options opt = {.type = NN_F32, .colors = 3};
    struct baked all, part;
    struct error err = {0};
    struct baker m;

    for (size_t i = 0; i < full->avatar.set.n; i += 3)
        full->avatar.all.opacity[i] = 0;    /* some that are never drawn */
    if (baked_from_avatar(&all, &full->avatar, false, &err) ||
        baker_open(&m, model, h, &opt, &err))
        give_up(&err);
    model_likeness(&m, verts);
    for (size_t i = 0; i < m.avatar.set.n; i += 3)
        m.avatar.all.opacity[i] = 0;
    if (baked_from_avatar(&part, &m.avatar, true, &err))
        give_up(&err);
    size_t dropped = baked_drop_clear(&all), N = all.N;
    int bad = dropped == 0 || part.C != 3 || part.N != N ||
              part.dynamic != all.dynamic || part.mouth != all.mouth ||
              part.first != all.first || part.blended != all.blended;
    bad = bad || model_differs(all.mean, 3, part.mean, 3, N) ||
          model_differs(all.scale, 3, part.scale, 3, N) ||
          model_differs(all.quat, 4, part.quat, 4, N) ||
          model_differs(all.opacity, 1, part.opacity, 1, N) ||
          model_differs(all.neck, 1, part.neck, 1, N) ||
          model_differs(all.uv, 2, part.uv, 2, N) ||
          model_differs(all.seen, 1, part.seen, 1, N) ||
          model_differs(all.reach, 1, part.reach, 1, N) ||
          model_differs(all.jaw, 3, part.jaw, 3, N) ||
          model_differs(all.color, all.C, part.color, 3, N) ||
          memcmp(all.branch, part.branch, N) ||
          memcmp(all.vertex, part.vertex, all.dynamic * sizeof *all.vertex);
    printf("three colours of what is drawn: %zu of %zu Gaussians, %s\n",
           part.N, N + dropped, bad ? "other ones" : "the same");
    baked_release(&all);
    baked_release(&part);
    baker_release(&m);
    return bad;
}

static int model_test(void)
{
    const struct baker_options opt = {.type = NN_F32};
    struct head h;
    struct identity id;
    struct model model;
    struct baker m;
    struct head_motion rest = {0};
    struct error err = {0};
    char path[] = "/tmp/avatar_model.XXXXXX";
    int fd = mkstemp(path);

    if (fd < 0)
        return 1;
    close(fd);
    sphere_head(&h, 20, 30);
    if (avatar_make(&h, shipped_mouth(), &err))
        give_up(&err);
    write_model(path, &h, "small");
    if (model_open(&model, path, &err) ||
        baker_open(&m, &model, &h, &opt, &err) ||
        head_fold(&id, &h, NULL, 0, &err))
        give_up(&err);
    unlink(path);
    float *verts = malloc(3 * h.V * sizeof *verts);
    head_pose(verts, &id, &rest);
    double psnr = model_likeness(&m, verts);
    printf("untrained avatar against its source: %.1f dB (at least 22)\n",
           psnr);
    int bad = model_part_test(&m, &model, &h, verts);
    free(verts);
    identity_release(&id);
    baker_release(&m);
    model_close(&model);
    head_release(&h);
    return !(psnr >= 22) || bad;
}

int main(int argc, char **argv)
{
    struct head h;
    struct error err = {0};

    if (argc == 1)
        return model_test();
    if (argc != 4) {
        printf("usage: avatar_model [OUT small|shipped HEAD]\n");
        return 1;
    }
    if (head_load(&h, argv[3], &err))
        give_up(&err);
    write_model(argv[1], &h, argv[2]);
    head_release(&h);
    return 0;
}
