/* What stands before a person is weighed out: no loss and no gradient of a
 * trained system changes with the pixels that are labelled as hidden, and they
 * do where the label is taken away. */
#include <unistd.h>

#include "lib/lab/data/data.h"
#include "lib/lab/train/avatar_system.h"
#include "tests/check.h"
#include "tests/unit/train_toy.h"

enum { S = 64, N = 32 };

static const char config[] =
    "{\"stage\":\"avatar\",\"seed\":7,\"batch\":1,\"micro\":1,\"pool\":1,"
    "\"targets\":1,\"image\":32,"
    "\"loss\":{\"silhouette\":1,\"square\":1,\"mouth\":1},"
    "\"model\":{\"size\":64,\"plane\":16,\"mouth\":4,\"channels\":8,"
    "\"feature\":8,\"backbone\":{\"type\":\"small\",\"width\":4},"
    "\"init\":{\"width\":4},\"static\":{\"width\":8},"
    "\"dynamic\":{\"width\":8,\"head\":8,\"vertex\":4},"
    "\"mouth_decoder\":{\"width\":8},\"rgb_skip\":true,"
    "\"refiner\":{\"type\":\"narrow\",\"width\":8}}}";

/* What the losses of one drawn frame say. */
struct hidden_result {
    double terms[PICTURE_COUNT];
    float drgb[3 * N * N], dcoarse[3 * N * N], dalpha[N * N];
};

/* A person of two frames, the second one with a square that is hidden. */
static void hidden_person(struct data_person *p, const char *path)
{
    struct error err = {0};
    const char *files[1] = {path};
    struct data_reader *r = data_open(files, 1, 0, &err);

    REQUIRE(r && !data_next(r, p, &err) && p->count > 1, "%s", err.text);
    data_close(r);
    struct data_frame *f = &p->frame[1];
    f->hidden = calloc(S * S, 1);
    for (size_t i = 0; i < S * S; i++)
        f->hidden[i] = i % S >= 24 && i % S < 40 && i / S >= 28 && i / S < 44;
}

/* Other colours and another mask under what is hidden. */
static void hidden_repaint(struct data_frame *f)
{
    for (size_t i = 0; i < 4 * S * S; i++)
        if (f->hidden[i / 4])
            f->rgba[i] = (uint8_t)(255 - f->rgba[i] / 2);
}

static void hidden_losses(struct hidden_result *out, struct avatar_system *s,
                          const struct data_frame *f,
                          const struct train_config *c)
{
    struct error err = {0};

    memset(out, 0, sizeof *out);
    REQUIRE(!avatar_system_losses(s, out->terms, f, c, 1, &err), "%s",
            err.text);
    memcpy(out->drgb, s->drgb, sizeof out->drgb);
    memcpy(out->dcoarse, s->dcoarse, sizeof out->dcoarse);
    memcpy(out->dalpha, s->drgb_alpha, sizeof out->dalpha);
}

/* The system with weights at random, baked from the first frame and drawn as
 * the second moves. */
static void hidden_draw(struct avatar_system *s, struct params *ps,
                        const struct train_config *c, const struct head *h,
                        const struct data_person *p)
{
    struct error err = {0};
    struct avatar_config model;
    struct identity id;
    struct head_motion m;
    float cam[12];

    params_init(ps);
    REQUIRE(!avatar_config_parse(&model, c->model, &err)
            && !avatar_system_init(s, ps, &model, h, &err)
            && !params_allocate(ps, &err)
            && !params_allocate_gradients(ps, &err), "%s", err.text);
    params_randomise(ps, 3);
    REQUIRE(!avatar_system_plan(s, N, true, false,
                                (struct nn_options){NN_TRAIN, NN_F32}, &err)
            && !head_fold(&id, h, p->shape, h->nshape, &err)
            && !avatar_system_bake(s, &p->frame[0], &id, NULL, NULL, &err),
            "%s", err.text);
    data_truth(&m, cam, &p->frame[1]);
    head_pose(s->verts, &id, &m);
    REQUIRE(!avatar_system_draw(s, s->verts, cam, &err), "%s", err.text);
    identity_release(&id);
}

int main(void)
{
    static struct hidden_result before, after, without;
    char dir[] = "/tmp/data_hidden.XXXXXX", path[100];
    struct train_config c;
    struct head h;
    struct params ps;
    struct avatar_system s = {0};
    struct data_person p = {0};
    struct error err = {0};

    REQUIRE(mkdtemp(dir), "no folder in /tmp");
    snprintf(path, sizeof path, "%s/p.spid", dir);
    toy_head(&h, 8);
    toy_stream(path, &h, 1, 2, S);
    REQUIRE(!train_config_parse(&c, config, "config", &err), "%s", err.text);
    hidden_person(&p, path);
    hidden_draw(&s, &ps, &c, &h, &p);

    struct data_frame *f = &p.frame[1];
    hidden_losses(&before, &s, f, &c);
    hidden_repaint(f);
    hidden_losses(&after, &s, f, &c);
    check_that("losses and gradients do not see what is hidden",
               !memcmp(&before, &after, sizeof before));
    free(f->hidden);
    f->hidden = NULL;
    hidden_losses(&without, &s, f, &c);
    for (int k = 0; k < PICTURE_COUNT; k++) {
        char what[80];

        if (k == PICTURE_ALIGNMENT)     /* wants a network */
            continue;
        snprintf(what, sizeof what, "%s: %.4g, without the label %.4g",
                 picture_term_name[k], after.terms[k], without.terms[k]);
        check_that(what, without.terms[k] > after.terms[k]);
    }

    data_person_release(&p);
    avatar_system_release(&s);
    params_release(&ps);
    train_config_release(&c);
    head_release(&h);
    unlink(path);
    rmdir(dir);
    return check_status();
}
