/* Phase A in one process: a source picture or stream to a baked avatar. */
#include "lib/animate/prepare.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/facedetect.h"
#include "formats/image.h"
#include "formats/module.h"
#include "lib/base/cpu.h"
#include "lib/base/kept.h"
#include "lib/base/parallel.h"

/* The head and its edges; in time that is left to a thread the detector, too. */
static void *prepare_run_head(void *prepare)
{
    struct prepare *p = prepare;
    struct prepare_loading *l = &p->loading;

    l->rc = head_load(&p->head, l->path, &l->err) ||
            densify_init(&p->dense, p->head.f, p->head.F, p->head.V, &l->err)
                ? -1 : 0;
    struct error none;          /* told where a face is looked for */
    if (l->running)
        p->detector = facedetect_open(&none);
    return NULL;
}

/* Until the head is there; whoever asks. */
static int prepare_await_head(struct prepare *p, struct error *err)
{
    struct prepare_loading *l = &p->loading;

    pthread_mutex_lock(&l->lock);
    if (l->running)
        pthread_join(l->thread, NULL);
    l->running = false;
    pthread_mutex_unlock(&l->lock);
    if (l->rc)
        *err = l->err;
    return l->rc;
}

int prepare_open(struct prepare *p, const char *model, const char *head,
                 struct error *err)
{
    struct prepare_loading *l = &p->loading;

    if (model_open(&p->model, model, err))
        return -1;
    *l = (struct prepare_loading){.lock = PTHREAD_MUTEX_INITIALIZER};
    snprintf(l->path, sizeof l->path, "%s", head);
    l->running = parallel_width() > 1;
    if (l->running && pthread_create(&l->thread, NULL, prepare_run_head, p))
        l->running = false;
    module_preload(p->soon, sizeof p->soon / sizeof *p->soon);
    if (!l->running)
        prepare_run_head(p);
    const int rc = encoders_open(&p->nets, &p->model, true, p->precision, err);
    if (p->once && l->running)
        return rc;
    return prepare_await_head(p, err) ? -1 : rc;
}

/* The networks of Phase A go. */
static void prepare_close_baker(struct prepare *p)
{
    if (p->has_baker)
        baker_release(&p->baker);
    p->has_baker = false;
}

void prepare_release(struct prepare *p)
{
    struct error none;

    prepare_await_head(p, &none);
    prepare_close_baker(p);
    facedetect_close(p->detector);
    encoders_release(&p->nets);
    model_close(&p->model);
    densify_release(&p->dense);
    head_release(&p->head);
    memset(p, 0, sizeof *p);
}

/* ---- reading a source -------------------------------------------------- */

/* The baked Gaussians of a stream's GAUS. */
struct prepare_baked {
    struct baked *to;
    size_t vertices;            /* that they may ride */
};

static int prepare_take_baked(const struct record *rec, void *baked,
                              struct error *err)
{
    const struct prepare_baked *b = baked;

    if (!record_is(rec, RECORD_GAUS))
        return 0;
    return baked_read(b->to, rec, b->vertices, err) ? -1 : 1;
}

/* Identity and, when there is one, the baked GAUS of a stream. */
static int prepare_read_stream(struct prepared *s, struct prepare *p,
                               const char *path, struct error *err)
{
    struct prepare_baked b = {&s->baked, p->dense.V + p->dense.E};

    return person_load(&s->person, path, p->head.nexp, err) ||
           stream_load(path, prepare_take_baked, &b, err) < 0 ? -1 : 0;
}

/* By a thread, if there may be one; NULL: there is nothing to do. */
static void prepare_start(struct prepare_beside *beside)
{
    if (beside && parallel_width() > 1)
        beside->running = !pthread_create(&beside->thread, NULL, beside->run,
                                          beside->ctx);
}

static void prepare_await(struct prepare_beside *beside)
{
    if (beside && beside->running)
        pthread_join(beside->thread, NULL);
}

/* E_m as the source's tracker has it, planned before it is asked for; what is
 * wrong is said then. */
static void *prepare_run_plan(void *prepare)
{
    struct prepare *p = prepare;
    struct motion_tta t;
    struct error none;

    if (prepare_await_head(p, &none) == 0 &&
        motion_tta_init(&t, &p->nets.motion, 1, &p->head, !p->track.no_tta,
                        p->track.across, false, &none) == 0)
        motion_tta_release(&t);
    return NULL;
}

/* The picture's face, shape, motion and matte, as spid-shape makes them. */
static int prepare_read_picture(struct prepared *s, struct prepare *p,
                                const char *path, const char *mask_path,
                                struct prepare_beside *beside,
                                struct error *err)
{
    struct track_options opt = p->track;
    struct image mask = {0}, *given = mask_path ? &mask : NULL;
    struct source src = {0};
    struct prepare_beside plan = {.run = prepare_run_plan, .ctx = p};

    prepare_start(&plan);
    int rc = image_read(&s->picture, path, err) ||
             (given && image_read(given, mask_path, err)) ? -1 : 0;

    prepare_await(&plan);
    if (rc || prepare_await_head(p, err))
        goto out;
    opt.size = (double)p->model.config.size;
    rc = source_find(&src, &s->picture, given, &p->head, &p->nets, &opt, err);
    if (rc == 0) {
        prepare_start(beside);
        rc = source_cut_out(&src, &s->picture, given, &p->head, &p->nets, err);
    }
    if (rc) {
        error_prefix(err, "%s", path);
        goto out;
    }
    s->notes = src.notes;
    s->person = source_move_person(&src);
out:
    source_release(&src);
    image_release(&mask);
    return rc;
}

/* ---- baking ------------------------------------------------------------ */

/* The networks of Phase A, loaded when first needed. */
static int prepare_open_baker(struct prepare *p, struct error *err)
{
    const struct baker_options opt = {
        .type = p->precision, .colors = p->star ? 3 : 0
    };

    if (!p->has_baker &&
        (prepare_await_head(p, err) ||
         baker_open(&p->baker, &p->model, &p->head, &opt, err)))
        return -1;
    p->has_baker = true;
    return 0;
}

/* The same, as a thread, and the driver's module; what is wrong is said when
 * they are needed. */
static void *prepare_run_open_baker(void *prepare)
{
    struct prepare *p = prepare;
    struct error err;

    prepare_open_baker(p, &err);
    module_preload(&p->then, 1);
    return NULL;
}

/* The Gaussians, then what is never drawn left out. */
static int prepare_bake(struct prepared *s, struct prepare *p,
                        struct error *err)
{
    float *verts = malloc(3 * p->head.V * sizeof *verts);
    if (!verts)
        return error_set(err, EX_OSERR, "no memory for a mesh");
    int rc = baker_bake(&p->baker, verts, &s->person, err) ||
             baker_copy(&s->baked, &p->baker, true, err) ? -1 : 0;
    free(verts);
    return rc;
}

int prepare_person(struct prepared *s, struct prepare *p, struct error *err)
{
    double begun = cpu_seconds();

    /* a copied motion points at the numbers it was copied from */
    s->person.source.pose.exp = s->person.source.exp;
    if (s->baked.N == 0 &&
        (prepare_open_baker(p, err) || prepare_bake(s, p, err)))
        goto fail;
    if (person_fold(&s->id, &p->head, &s->person, err))
        goto fail;              /* once its offset is known */
    if (p->once)
        prepare_close_baker(p);
    if (s->person.back && baked_has_places(&s->baked) &&
        texture_init(&s->texture, s->person.rgb, s->person.matte,
                     s->person.back, s->person.size, err))
        goto fail;
    s->texture.grain = s->baked.grain;
    s->texture.grain_size = s->baked.grain_size;
    s->bake_s = cpu_seconds() - begun;
    return 0;
fail:
    prepared_release(s);
    return -1;
}

/* A picture, while another thread loads what bakes it. */
static int prepare_from_picture(struct prepared *s, struct prepare *p,
                                const char *path, const char *mask,
                                struct prepare_beside *beside,
                                struct error *err)
{
    struct prepare_beside opening = {.run = prepare_run_open_baker, .ctx = p};

    if (!p->has_baker)
        prepare_start(&opening);
    const int rc = prepare_read_picture(s, p, path, mask, beside, err);

    prepare_await(&opening);
    return rc;
}

/* The source at path, and the Gaussians and whatever else is made of it. */
static int prepare_all(struct prepared *s, struct prepare *p, bool stream,
                       const char *path, const char *mask,
                       struct prepare_beside *beside, struct error *err)
{
    double begun = cpu_seconds();

    if (stream ? prepare_read_stream(s, p, path, err)
               : prepare_from_picture(s, p, path, mask, beside, err)) {
        prepared_release(s);
        return -1;
    }
    s->shape_s = cpu_seconds() - begun;
    begun = cpu_seconds();
    if (s->baked.N == 0 && prepare_open_baker(p, err)) {
        prepared_release(s);    /* the model's fault, not the source's */
        return -1;
    }
    const double opening = cpu_seconds() - begun;
    if (prepare_person(s, p, err))
        return error_prefix(err, "%s", path);
    s->bake_s += opening;
    return 0;
}

int prepare_source(struct prepared *s, struct prepare *p, const char *path,
                   const char *mask, struct prepare_beside *beside,
                   struct error *err)
{
    struct kept kept;
    const char *file = kept_open(&kept, path, IMAGE_MAX_BYTES, err);

    memset(s, 0, sizeof *s);
    if (!file)
        return -1;
    const bool stream = stream_probe(file);
    if (stream && prepare_await_head(p, err))
        return kept_close(&kept, -1, err);
    if (stream)
        prepare_start(beside);
    int rc = prepare_all(s, p, stream, file, mask, beside, err);
    prepare_await(beside);
    return kept_close(&kept, rc, err);
}

struct pipeline_avatar prepared_avatar(const struct prepared *s,
                                       const struct prepare *p)
{
    return (struct pipeline_avatar){
        &s->id, &s->baked, &p->dense, s->texture.levels ? &s->texture : NULL
    };
}

void prepared_release(struct prepared *s)
{
    texture_release(&s->texture);
    image_release(&s->picture);
    identity_release(&s->id);
    baked_release(&s->baked);
    person_release(&s->person);
    memset(s, 0, sizeof *s);
}
