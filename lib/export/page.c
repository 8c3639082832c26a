/* What a page holds of an avatar and its drive, as the arrays of an archive:
 * the Gaussians, the head with the identity folded in, the motion and the
 * photograph. */
#include "lib/export/page.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sysexits.h>

#include "formats/pagefile.h"
#include "lib/base/file.h"
#include "lib/base/list.h"
#include "lib/base/relative_pose.h"
#include "lib/export/page_pack.h"
#include "lib/head/arkit.h"

/* ---- gathering ---------------------------------------------------------- */

void page_init(struct page *p, size_t nexp)
{
    memset(p, 0, sizeof *p);
    p->nexp = nexp;
}

void page_release(struct page *p)
{
    baked_release(&p->baked);
    free(p->motion);
    free(p->time);
    memset(p, 0, sizeof *p);
}

/* The Gaussians; a later set takes the place of an earlier one. */
static int page_take_avatar(struct page *p, const struct record *rec,
                            struct error *err)
{
    struct baked next;

    if (baked_read(&next, rec, 0, err))
        return -1;
    if (next.N == 0 || next.N > PAGE_MAX_GAUSSIANS) {
        size_t n = next.N;

        baked_release(&next);
        return error_set(err, EX_DATAERR, "GAUS has %zu Gaussians (expected 1 "
                         "to %d in a page)", n, PAGE_MAX_GAUSSIANS);
    }
    baked_release(&p->baked);
    p->baked = next;
    p->has_avatar = true;
    return 0;
}

/* Room for one frame more. */
static int page_grow(struct page *p, struct error *err)
{
    const struct list_column all[] = {
        {&p->motion, (PAGE_POSE + p->nexp) * sizeof *p->motion},
        {&p->time, sizeof *p->time}};

    if (p->frames == PAGE_MAX_FRAMES)
        return error_set(err, EX_DATAERR, "the drive is too long for a page "
                         "(expected at most %d frames)", PAGE_MAX_FRAMES);
    return list_grow_columns(all, 2, &p->room, p->frames)
               ? error_set(err, EX_OSERR, "out of memory for frames") : 0;
}

void page_row(float *to, const struct motion *m, size_t nexp)
{
    memcpy(to, m->R, sizeof m->R);
    memcpy(to + 9, m->t, sizeof m->t);
    memcpy(to + 12, m->pose.jaw, sizeof m->pose.jaw);
    memcpy(to + 15, m->pose.lid, sizeof m->pose.lid);
    memcpy(to + 17, m->pose.eye, sizeof m->pose.eye);
    memcpy(to + PAGE_POSE, m->exp, nexp * sizeof *m->exp);
}

void page_motion(struct motion *m, const float *row, size_t nexp)
{
    memset(m, 0, sizeof *m);
    memcpy(m->R, row, sizeof m->R);
    memcpy(m->t, row + 9, sizeof m->t);
    memcpy(m->pose.jaw, row + 12, sizeof m->pose.jaw);
    memcpy(m->pose.lid, row + 15, sizeof m->pose.lid);
    memcpy(m->pose.eye, row + 17, sizeof m->pose.eye);
    memcpy(m->exp, row + PAGE_POSE, nexp * sizeof *m->exp);
}

/* A frame of the drive. */
static int page_take_motion(struct page *p, const struct record *rec,
                            struct error *err)
{
    struct motion m;

    if (motion_read(&m, rec, p->nexp, err) || page_grow(p, err))
        return -1;
    if (p->frames && !(rec->time > p->time[p->frames - 1]))
        return error_set(err, EX_DATAERR, "time %g follows %g (expected "
                         "increasing times)", rec->time,
                         p->time[p->frames - 1]);
    page_row(p->motion + p->frames * (PAGE_POSE + p->nexp), &m,
                      p->nexp);
    p->time[p->frames++] = rec->time;
    return 0;
}

int page_record(struct page *p, const struct record *rec, struct error *err)
{
    p->moved |= record_is(rec, RECORD_GMOV) || record_is(rec, RECORD_MESH);
    if (record_is(rec, RECORD_GAUS))
        return page_take_avatar(p, rec, err);
    if (record_is(rec, RECORD_MOTN))
        return page_take_motion(p, rec, err);
    return 0;
}

static int page_take_gaussians(const struct record *rec, void *page,
                               struct error *err)
{
    return record_is(rec, RECORD_GAUS) ? page_take_avatar(page, rec, err) : 0;
}

int page_load_avatar(struct page *p, const char *path, struct error *err)
{
    return stream_load(path, page_take_gaussians, p, err);
}

/* ---- what is packed ----------------------------------------------------- */

/* Two ends of an edge, or the same vertex twice, for each dynamic Gaussian. */
static int page_pack_rides(struct pack *k, const struct baked *b,
                           const struct head *h, struct error *err)
{
    struct densify d;

    if (densify_init(&d, h->f, h->F, h->V, err))
        return -1;
    int32_t *to = page_pack_add(k, "rides", ST_I32, b->dynamic, 2, NULL);
    int rc = 0;
    for (size_t i = 0; to && !rc && i < b->dynamic; i++) {
        size_t v = (size_t)b->vertex[i], end[2];

        if (v >= d.V + d.E) {
            rc = error_set(err, EX_DATAERR, "GAUS vertex[%zu] is %zu "
                           "(expected under %zu: the avatar belongs to "
                           "another head)", i, v, d.V + d.E);
            break;
        }
        densify_ends(end, &d, v);
        to[2 * i] = (int32_t)end[0];
        to[2 * i + 1] = (int32_t)end[1];
    }
    densify_release(&d);
    return rc;
}

/* The baked Gaussians as the page draws them; dynamic ones ride on the
 * mesh. */
static void page_pack_gaussians(struct pack *k, const struct baked *b)
{
    const int32_t counts[3] = {(int32_t)b->dynamic,
                               (int32_t)(b->N - b->dynamic - b->mouth),
                               (int32_t)b->mouth};

    page_pack_add(k, "counts", ST_I32, 3, 0, counts);
    /* the others ride on the mesh */
    page_pack_columns(k, "mean", b->mean + 3 * b->dynamic, b->N - b->dynamic, 3,
                      3);
    page_pack_columns(k, "scale", b->scale, b->N, 3, 3);
    page_pack_columns(k, "quat", b->quat, b->N, 4, 4);
    page_pack_columns(k, "opacity", b->opacity, b->N, 1, 1);
    page_pack_columns(k, "color", b->color, b->N, b->C, b->C < 3 ? b->C : 3);
    page_pack_columns(k, "bend", b->neck, b->N, 1, 1);
    page_pack_add(k, "pivot", ST_F32, 3, 0, b->pivot);
    if (baked_has_places(b))
        page_pack_add(k, "view", ST_F32, 3, 4, b->view);
    page_pack_add(k, "shoulders", ST_F32, 3, 3, b->source);
    page_pack_add(k, "lip", ST_F32, 3, 0, b->lip);
    if (!b->has_jaw)
        return;
    page_pack_columns(k, "jaw", b->jaw + 3 * (b->N - b->mouth), b->mouth, 3, 3);
    page_pack_add(k, "chin", ST_F32, 3, 0, b->chin);
}

/* The mesh: what its vertices are. */
static void page_pack_mesh(struct pack *k, const struct identity *id)
{
    const struct head *h = id->head;

    page_pack_head(k, id);
    page_pack_add(k, "faces", ST_I32, h->F, 3, h->f);
    page_pack_add(k, "lip_inner", ST_I32, h->nlip_inner, 0, h->lip_inner);
    page_pack_add(k, "chin_vertices", ST_I32, h->nchin, 0, h->chin);
}

/* The clip's frames, and the source's own motion for the page to start
 * from. */
static void page_pack_motion(struct pack *k, const struct page *p,
                             const struct person *person)
{
    const size_t width = PAGE_POSE + p->nexp;

    page_pack_add(k, "motion", ST_F32, p->frames, width, p->motion);
    page_pack_add(k, "time", ST_F64, p->frames, 0, p->time);
    if (!person->has_source)
        return;
    float *to = page_pack_add(k, "source", ST_F32, 1, width, NULL);
    if (to)
        page_row(to, &person->calm, p->nexp);
}

/* Number, home, reach of the Gaussians that the photograph shows only near
 * home. */
static void page_pack_reach(struct pack *k, const struct baked *b)
{
    size_t n = 0;

    for (size_t i = 0; i < b->N; i++)
        n += b->reach[i] != 0;
    float *to = n ? page_pack_add(k, "reach", ST_F32, n, 5, NULL) : NULL;
    for (size_t i = 0; to && i < b->N; i++) {
        if (b->reach[i] == 0)
            continue;
        to[0] = (float)i;
        memcpy(to + 1, b->mean + 3 * i, 3 * sizeof *to);
        to[4] = b->reach[i];
        to += 5;
    }
}

/* The source picture, and places in it where the Gaussians have them. */
static int page_pack_photograph(struct pack *k, const struct baked *b,
                                const struct person *person,
                                struct error *err)
{
    const size_t S = person->size;
    float lamp[LAMP_SIZE];

    if (!person->rgb)
        return 0;
    if (S < 2 || S > PAGE_MAX_PIXELS)
        return error_set(err, EX_DATAERR, "SRCI has %zu x %zu pixels "
                         "(expected 2 to %d in a page)", S, S,
                         PAGE_MAX_PIXELS);
    page_pack_picture(k, "rgb", person->rgb, S, 3);
    page_pack_picture(k, "matte", person->matte, S, 1);
    if (!person->back)
        return 0;
    page_pack_picture(k, "back", person->back, S, 3);
    if (!baked_has_places(b))
        return 0;
    page_pack_columns(k, "uv", b->uv, b->N, 2, 2);
    page_pack_columns(k, "seen", b->seen, b->N, 1, 1);
    page_pack_columns(k, "tilt", b->tilt, b->N, 2, 2);
    if (b->grain) {
        page_pack_columns(k, "around", b->around, b->N, 2, 2);
        page_pack_picture(k, "grain", b->grain, b->grain_size, 1);
    }
    if (baked_is_lit(b)) {
        page_pack_columns(k, "normal", b->normal, b->N, 3, 3);
        page_pack_add(k, "light", ST_F32, 3, 0, b->light);
        relative_light(lamp, b->lamp, b->view);
        page_pack_add(k, "lamp", ST_F32, LAMP_SIZE, 0, lamp);
    }
    page_pack_reach(k, b);
    return 0;
}

/* Whether what came makes a page. */
static int page_check(const struct page *p, const struct person *person,
                      struct error *err)
{
    if (!p->has_avatar || !person->shape)
        return error_set(err, EX_DATAERR, "no %s record for --html (expected "
                         "an avatar, as spid-branches --bake writes it, in "
                         "the stream or by -i)",
                         p->has_avatar ? RECORD_SHAP : RECORD_GAUS);
    if (p->moved && !p->frames)
        return error_set(err, EX_DATAERR, "this stream has what moved, not "
                         "the motion (expected MOTN records, as spid-motion "
                         "writes them)");
    if (p->live_model && !person->has_source)
        return error_set(err, EX_DATAERR, "the avatar has no motion of its "
                         "own, from which --live moves it (expected MOTN "
                         "beside SRCI, as spid-shape writes them)");
    return 0;
}

/* A file's bytes as an array. */
static int page_add_file(struct pack *k, const char *name, const char *path,
                         struct error *err)
{
    size_t bytes;
    void *file = file_map(&bytes, path, err), *to;

    if (!file)
        return -1;
    to = page_pack_add(k, name, ST_U8, bytes, 0, NULL);
    if (to)
        memcpy(to, file, bytes);
    munmap(file, bytes);
    return 0;
}

int page_write(const struct page *p, const char *path,
               const char *template_path, const struct identity *id,
               const struct person *person, size_t *bytes, struct error *err)
{
    struct pack *k = calloc(1, sizeof *k);
    char names[ARKIT_NAMES] = "[]";
    int rc = -1;

    if (!k)
        return error_set(err, EX_OSERR, "out of memory for a page");
    if (head_has_arkit(id->head))
        arkit_names(names);
    if (page_check(p, person, err) ||
        page_pack_rides(k, &p->baked, id->head, err) ||
        page_pack_photograph(k, &p->baked, person, err) ||
        (p->live_model &&
         (page_add_file(k, "engine.model", p->live_model, err) ||
          page_add_file(k, "engine.head", p->live_head, err))))
        goto out;
    page_pack_gaussians(k, &p->baked);
    page_pack_mesh(k, id);
    page_pack_motion(k, p, person);
    const char *const meta[] = {"format", "spid-page", "names", names, NULL};
    if (arena_check(&k->memory, "a page", err))
        goto out;
    if (template_path)
        rc = pagefile_write(path, template_path, k->tensor, k->count, meta,
                            bytes, err);
    else
        rc = st_save(path, k->tensor, k->count, meta, err);
out:
    arena_release(&k->memory);
    free(k);
    return rc;
}
