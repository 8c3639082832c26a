/* A model file with untrained weights: written, read back, baked; the picture
 * must show the source already.  With arguments OUT [small|shipped|paper] and
 * a head model it only writes the file, for the pipe tests. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/baked.h"
#include "lib/avatar/model.h"
#include "lib/net/motion_encoder.h"
#include "lib/net/refiner.h"
#include "lib/net/shape_encoder.h"

static void give_up(const struct error *err)
{
    printf("%s\n", err->text);
    exit(1);
}

static void configure(struct avatar_config *c, const char *kind)
{
    if (strcmp(kind, "paper") == 0) {
        avatar_config_shipped(c);
        c->plane = c->backbone.size = 296;
        c->mouth = 32;
        return;
    }
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

    configure(&c, kind);
    memcpy(c.head_hash, h->hash, sizeof c.head_hash);
    params_init(&ps);
    if (motion_encoder_init(&motion, &ps, "motion.", c.motion_net, &err) ||
        shape_encoder_init(&shape, &ps, "shape.", c.shape_net, &err) ||
        avatar_init(&a, &ps, &c, h, &err) ||
        refiner_init(&r, &ps, "refine.", &c.refiner, &err) ||
        params_allocate(&ps, &err))
        give_up(&err);
    params_randomise(&ps, 1);
    motion_encoder_start(&motion);
    avatar_start(&a);
    char *json = avatar_config_print(&c);
    const char *meta[] = {"spid", json, NULL};
    if (params_save(&ps, path, ST_F32, meta, &err))
        give_up(&err);
    free(json);
    refiner_release(&r);
    avatar_release(&a);
    shape_encoder_release(&shape);
    motion_encoder_release(&motion);
    params_release(&ps);
}

int main(int argc, char **argv)
{
    struct head h;
    struct error err = {0};

    if (argc != 4) {
        printf("usage: avatar_model OUT small|shipped|paper HEAD\n");
        return argc == 1 ? 77 : 1;
    }
    if (head_load(&h, argv[3], &err))
        give_up(&err);
    write_model(argv[1], &h, argv[2]);
    head_release(&h);
    return 0;
}
