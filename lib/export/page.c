/* What a page holds of an avatar and its drive, as the arrays of an archive:
 * the Gaussians, the head with the identity folded in, the motion and the
 * photograph. */
#include "lib/export/page.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/pagefile.h"
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
    if (next.N == 0 || next.N > PAGE_MOST_GAUSSIANS) {
        size_t n = next.N;

        baked_release(&next);
        return error_set(err, EX_DATAERR, "GAUS has %zu Gaussians (expected 1 "
                         "to %d in a page)", n, PAGE_MOST_GAUSSIANS);
    }
    baked_release(&p->baked);
    p->baked = next;
    p->has_avatar = true;
    return 0;
}

/* Room for one frame more. */
static int page_grow(struct page *p, struct error *err)
{
    size_t room = p->room ? 2 * p->room : 256;
    float *motion;
    double *time;

    if (p->frames == PAGE_MOST_FRAMES)
        return error_set(err, EX_DATAERR, "the drive is too long for a page "
                         "(expected at most %d frames)", PAGE_MOST_FRAMES);
    if (p->frames < p->room)
        return 0;
    if ((motion = realloc(p->motion, room * (PAGE_POSE + p->nexp) *
                                         sizeof *motion)))
        p->motion = motion;
    if ((time = realloc(p->time, room * sizeof *time)))
        p->time = time;
    if (!motion || !time)
        return error_set(err, EX_OSERR, "out of memory for %zu frames", room);
    p->room = room;
    return 0;
}

/* m in PAGE_POSE + nexp numbers. */
static void page_store_motion(float *to, const struct motion *m, size_t nexp)
{
    memcpy(to, m->R, sizeof m->R);
    memcpy(to + 9, m->t, sizeof m->t);
    memcpy(to + 12, m->pose.jaw, sizeof m->pose.jaw);
    memcpy(to + 15, m->pose.lid, sizeof m->pose.lid);
    memcpy(to + 17, m->pose.eye, sizeof m->pose.eye);
    memcpy(to + PAGE_POSE, m->exp, nexp * sizeof *m->exp);
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
    page_store_motion(p->motion + p->frames * (PAGE_POSE + p->nexp), &m,
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

int page_load_avatar(struct page *p, const char *path, struct error *err)
{
    struct record rec;
    struct stream_reader *in = stream_open(path, NULL, err);
    int rc = in ? 1 : -1;

    while (rc > 0 && (rc = stream_read(in, &rec, err)) > 0)
        if (record_is(&rec, RECORD_GAUS) && page_take_avatar(p, &rec, err))
            rc = error_prefix(err, "%s", path);
    stream_close(in);
    return rc;
}

/* ---- packing ------------------------------------------------------------ */

#define PACK_MOST 64            /* arrays of an archive */

/* Arrays on their way into the archive, with the memory they own. */
struct pack {
    struct st_tensor tensor[PACK_MOST];
    size_t count;
    char name[PACK_MOST][24];
    void *owned[PACK_MOST];
    bool failed;                /* memory was short */
};

static void page_pack_release(struct pack *k)
{
    for (size_t i = 0; i < k->count; i++)
        free(k->owned[i]);
}

/* An array (d0, d1) of `bytes`, copied; d1 0: one dimension. */
static void *page_pack_add(struct pack *k, const char *name,
                           enum st_dtype dtype, size_t d0, size_t d1,
                           const void *data)
{
    const size_t count = d0 * (d1 ? d1 : 1);
    const size_t bytes = count * st_dtype_size(dtype), i = k->count;
    void *copy = k->failed || i == PACK_MOST ? NULL : malloc(bytes + 1);

    if (!copy) {
        k->failed = true;
        return NULL;
    }
    if (data)
        memcpy(copy, data, bytes);
    snprintf(k->name[i], sizeof k->name[i], "%s", name);
    k->owned[i] = copy;
    k->tensor[i] = (struct st_tensor){
        .name = k->name[i], .dtype = dtype, .ndim = d1 ? 2 : 1,
        .dim = {d0, d1}, .count = count, .data = copy};
    k->count++;
    return copy;
}

/* Ends of what 16 bits will tell apart; 0 has a number of its own, so that
 * what does not move stays where it is. */
static void page_pack_range(float range[2], const float *x, size_t n,
                            size_t stride)
{
    float lo = n ? x[0] : 0, hi = lo;

    for (size_t i = 0; i < n; i++) {
        lo = fminf(lo, x[i * stride]);
        hi = fmaxf(hi, x[i * stride]);
    }
    if (lo < 0 && hi > 0) {
        hi = fmaxf(-lo, hi);
        lo = -hi;
    }
    range[0] = lo;
    range[1] = hi;
}

/* Columns of x (n rows of `stride` numbers, the first K of them) one after the
 * other: name (K,n) in 16 bits, from 0 for range[k][0] to 65534 for
 * range[k][1] of name.range (K,2). */
static void page_pack_columns(struct pack *k, const char *name, const float *x,
                              size_t n, size_t stride, size_t K)
{
    char range_name[24];

    snprintf(range_name, sizeof range_name, "%s.range", name);
    uint16_t *to = page_pack_add(k, name, ST_U16, K, n, NULL);
    float *range = page_pack_add(k, range_name, ST_F32, K, 2, NULL);
    if (!to || !range)
        return;
    for (size_t c = 0; c < K; c++) {
        float *r = range + 2 * c;

        page_pack_range(r, x + c, n, stride);
        double step = r[1] > r[0] ? 65534 / ((double)r[1] - r[0]) : 0;
        for (size_t i = 0; i < n; i++)
            to[c * n + i] = (uint16_t)lrint((x[i * stride + c] - r[0]) *
                                            step);
    }
}

/* Directions of the head's posing layout, each a row: name (K,3V). */
static void page_pack_directions(struct pack *k, const char *name,
                                 const struct head *h, const float *dirs,
                                 size_t K)
{
    char range_name[24];
    float *row = malloc((3 * h->V + 1) * sizeof *row);

    snprintf(range_name, sizeof range_name, "%s.range", name);
    uint16_t *to = page_pack_add(k, name, ST_U16, K, 3 * h->V, NULL);
    float *range = page_pack_add(k, range_name, ST_F32, K, 2, NULL);
    k->failed |= !row;
    for (size_t d = 0; to && range && row && d < K; d++) {
        float *r = range + 2 * d;

        head_direction(row, h, dirs, K, d);
        page_pack_range(r, row, 3 * h->V, 1);
        double step = r[1] > r[0] ? 65534 / ((double)r[1] - r[0]) : 0;
        for (size_t i = 0; i < 3 * h->V; i++)
            to[3 * h->V * d + i] = (uint16_t)lrint((row[i] - r[0]) * step);
    }
    free(row);
}

/* Pixels as what each differs by from the one on its left: half the size when
 * deflated. */
static void page_pack_picture(struct pack *k, const char *name,
                              const uint8_t *pixel, size_t S, size_t channels)
{
    uint8_t *to = page_pack_add(k, name, ST_U8, S, S * channels, NULL);

    for (size_t y = 0; to && y < S; y++)
        for (size_t x = 0; x < S * channels; x++) {
            const uint8_t *p = pixel + y * S * channels + x;

            to[y * S * channels + x] =
                (uint8_t)(x < channels ? *p : *p - p[-(ptrdiff_t)channels]);
        }
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

/* The identity's head: Eq. M with beta folded in. */
static void page_pack_head(struct pack *k, const struct identity *id)
{
    const struct head *h = id->head;
    float joints[3 * HEAD_JOINTS];

    for (int i = 0; i < 3 * HEAD_JOINTS; i++)
        joints[i] = (float)id->joints[i];
    page_pack_directions(k, "shaped", h, id->shaped, 1);
    page_pack_directions(k, "lids", h, id->lids, 2);
    page_pack_directions(k, "exp_dirs", h, h->exp_dirs, h->nexp);
    page_pack_directions(k, "pose_dirs", h, h->pose_dirs, HEAD_POSE_DIRS);
    page_pack_columns(k, "weights", h->weights, h->V, HEAD_JOINTS, HEAD_JOINTS);
    page_pack_add(k, "joints", ST_F32, HEAD_JOINTS, 3, joints);
    page_pack_add(k, "joint_exp", ST_F32, h->nexp, 3 * HEAD_JOINTS,
                  h->joint_exp);
    page_pack_add(k, "parents", ST_I32, HEAD_JOINTS, 0, h->parents);
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
        page_store_motion(to, &person->source, p->nexp);
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

    if (!person->rgb)
        return 0;
    if (S < 2 || S > PAGE_MOST_PIXELS)
        return error_set(err, EX_DATAERR, "SRCI has %zu x %zu pixels "
                         "(expected 2 to %d in a page)", S, S,
                         PAGE_MOST_PIXELS);
    page_pack_picture(k, "rgb", person->rgb, S, 3);
    page_pack_picture(k, "matte", person->matte, S, 1);
    if (!person->back)
        return 0;
    page_pack_picture(k, "back", person->back, S, 3);
    if (!baked_has_places(b))
        return 0;
    page_pack_columns(k, "uv", b->uv, b->N, 2, 2);
    page_pack_columns(k, "seen", b->seen, b->N, 1, 1);
    page_pack_reach(k, b);
    return 0;
}

/* Names of the expression directions as a JSON list; empty where the head
 * does not name them. */
static char *page_names(const struct head *h)
{
    cJSON *list = cJSON_CreateArray();

    for (int i = 0; head_has_arkit(h) && i < ARKIT_COUNT; i++)
        cJSON_AddItemToArray(list, cJSON_CreateString(arkit_name(i)));
    char *text = cJSON_PrintUnformatted(list);
    cJSON_Delete(list);
    return text;
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
    return 0;
}

int page_write(const struct page *p, const char *path,
               const char *template_path, const struct identity *id,
               const struct person *person, size_t *bytes, struct error *err)
{
    struct pack *k = calloc(1, sizeof *k);
    char *names = page_names(id->head);
    int rc = -1;

    if (!k || !names) {
        error_set(err, EX_OSERR, "out of memory for a page");
        goto out;
    }
    if (page_check(p, person, err) ||
        page_pack_rides(k, &p->baked, id->head, err) ||
        page_pack_photograph(k, &p->baked, person, err))
        goto out;
    page_pack_gaussians(k, &p->baked);
    page_pack_head(k, id);
    page_pack_motion(k, p, person);
    const char *const meta[] = {"format", "spid-page", "names", names, NULL};
    rc = k->failed
             ? error_set(err, EX_OSERR, "out of memory for a page")
             : pagefile_write(path, template_path, k->tensor, k->count, meta,
                              bytes, err);
out:
    cJSON_free(names);
    if (k)
        page_pack_release(k);
    free(k);
    return rc;
}
