/* The folder's lists, labels and meshes, read once and checked against the
 * head. */
#include "lib/lab/people/scan.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/names.h"
#include "lib/base/parallel.h"
#include "lib/base/vec3.h"

#define PATH 4096
#define CLOTHES_MIN (-2.6f)     /* of clothes, head units */

/* ---- folders ------------------------------------------------------------ */

static int scan_compare(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

static bool scan_is_folder(const char *entry) { return entry[0] != '.'; }
static bool scan_is_hdr(const char *entry) { return file_ends(entry, ".hdr"); }
static bool scan_is_png(const char *entry) { return file_ends(entry, ".png"); }
static bool scan_is_mhclo(const char *entry)
{
    return file_ends(entry, ".mhclo");
}

/* What of dir is wanted, in the order of bytes; -1 and *err when there is
 * none. */
static int scan_list(struct names *n, const char *dir,
                     bool wanted(const char *entry), struct error *err)
{
    const int found = names_add_folder(n, dir, wanted, err);

    if (found > 0)
        qsort(n->name, n->count, sizeof *n->name, scan_compare);
    return found > 0 ? 0 : found < 0 ? -1
        : error_set(err, EX_NOINPUT, "%s: nothing of its kind (expected at "
                    "least one)", dir);
}

/* ---- pieces ------------------------------------------------------------- */

/* One piece of each folder in DIR/makehuman/kind.  The picture is the PNG that
 * ends in `picture`; NULL: it has none. */
static int scan_load_rack(struct scan_rack *r, struct scan_assets *a,
                          const char *dir, const char *kind,
                          const char *picture, const char *only, float above,
                          struct error *err)
{
    struct names folder = {0};
    char path[PATH];

    snprintf(path, sizeof path, "%s/makehuman/%s", dir, kind);
    int rc = scan_list(&folder, path, scan_is_folder, err);
    for (size_t i = 0; !rc && i < folder.count; i++) {
        const char *base = folder.name[i], *name = strrchr(base, '/') + 1;
        struct names bind = {0};
        char file[PATH];

        if (only ? strcmp(name, only) : !strncmp(name, "fedora", 6))
            continue;
        snprintf(file, sizeof file, "%s%s", name, picture ? picture : "");
        rc = scan_list(&bind, base, scan_is_mhclo, err);
        for (size_t k = 0; !rc && k < bind.count && r->n < SCAN_PIECES; k++) {
            char *mesh = strrchr(bind.name[k], '/') + 1;

            mesh[strlen(mesh) - strlen(".mhclo")] = 0;
            rc = piece_load(&r->piece[r->n++], &a->body, base, mesh,
                            picture ? file : NULL, above, &a->memory, err);
        }
        names_release(&bind);
    }
    names_release(&folder);
    return rc;
}

/* The pictures of irises. */
static int scan_load_irises(struct scan_assets *a, const char *dir,
                            struct error *err)
{
    struct names picture = {0};
    char path[PATH];

    snprintf(path, sizeof path, "%s/makehuman/eyes/materials", dir);
    int rc = scan_list(&picture, path, scan_is_png, err);
    for (size_t i = 0; !rc && i < picture.count && i < SCAN_PIECES; i++)
        rc = bitmap_load(&a->iris[a->niris++], picture.name[i], &a->memory,
                         err);
    names_release(&picture);
    return rc;
}

struct scan_lights {
    struct scan_assets *a;
    char **name;
};

/* Panorama i. */
static int scan_load_light(void *ctx, size_t i, struct error *err)
{
    const struct scan_lights *c = ctx;

    return light_map_load(&c->a->light[i], c->name[i], &c->a->memory, err);
}

/* All panoramas, each made ready by a thread; or that one (NULL: all). */
static int scan_load_lights(struct scan_assets *a, const char *dir,
                            const char *one, struct error *err)
{
    struct names panorama = {0};
    char path[PATH];

    snprintf(path, sizeof path, "%s/hdri", dir);
    if (one) {
        a->nlight = 1;
        a->light = arena_take(&a->memory, 1, sizeof *a->light);
        return arena_check(&a->memory, "lights", err) ||
               light_map_load(a->light, one, &a->memory, err) ? -1 : 0;
    }
    int rc = scan_list(&panorama, path, scan_is_hdr, err);
    a->nlight = panorama.count;
    a->light = arena_take(&a->memory, a->nlight, sizeof *a->light);
    rc = rc || arena_check(&a->memory, "lights", err) ||
         parallel_try(a->nlight, scan_load_light,
                      &(struct scan_lights){a, panorama.name}, err) ? -1 : 0;
    names_release(&panorama);
    return rc;
}

/* The body's skin from the neck down. */
static int scan_make_torso(struct scan_assets *a, struct error *err)
{
    const struct body *b = &a->body;
    struct arena room = {0};
    int32_t *f = arena_take(&room, 3 * b->mesh.nf, sizeof *f);
    float *p = arena_take(&room, 3 * b->nbody, sizeof *p);
    size_t n = 0;
    int rc = arena_check(&room, "the body", err);

    for (size_t i = 0; !rc && i < b->mesh.nf; i++) {
        const int32_t *v = b->mesh.f + 3 * i;
        if (b->place[3 * v[0] + 1] < -0.72f
            || b->place[3 * v[1] + 1] < -0.72f)
            memcpy(f + 3 * n++, v, 3 * sizeof *f);
    }
    /* a little inside of clothes, and of the scans' neck */
    for (size_t i = 0; !rc && i < b->nbody; i++) {
        const float *q = b->place + 3 * i;
        float in = 0.006f + 0.010f * ramp(-1.1f, -1.4f, q[1]);
        float d[3] = {q[0], 0, q[2] + 0.45f};
        float l = length3(d);
        copy3(p + 3 * i, q);
        if (l > 0.05f)
            mad3(p + 3 * i, q, d, -in / l);
    }
    rc = rc || piece_make(&a->torso, b, p, b->nbody, f, n, CLOTHES_MIN,
                          &a->memory, err) ? -1 : 0;
    arena_release(&room);
    return rc;
}

uint8_t scan_label_of(int32_t region)
{
    static const uint8_t label[REGION_COUNT] = {
        LABEL_SKIN, LABEL_SKIN, LABEL_LIP, LABEL_SKIN, LABEL_SKIN,
        LABEL_EAR, LABEL_NECK, LABEL_NOSE, LABEL_SKIN, LABEL_LIP
    };

    return region >= 0 && region < REGION_COUNT ? label[region] : LABEL_SKIN;
}

/* What the vertices are, after the nearest of the head's. */
static int scan_find_labels(struct scan_assets *a, const struct head *h,
                            struct error *err)
{
    struct near_tree g;

    a->label = arena_take(&a->memory, FACE_VERTICES, 1);
    a->hairy = arena_take(&a->memory, FACE_VERTICES, sizeof *a->hairy);
    if (arena_check(&a->memory, "the scans", err))
        return -1;
    memset(a->label, LABEL_SKIN, FACE_VERTICES);
    if (!h->region)
        return 0;
    if (near_init(&g, h->v_template, h->V, &a->memory, err))
        return -1;
    for (size_t i = 0; i < FACE_NECK_END; i++) {
        int32_t at = 0;
        near_find(&at, NULL, &g, a->face.neutral + 3 * i, NULL, 1, 10);
        a->hairy[i] = h->hair ? h->hair[at] : 0;
        a->label[i] = scan_label_of(h->region[at]);
    }
    return 0;
}

/* The corners that the labels' landmarks mean. */
static int scan_find_points(struct scan_assets *a, const char *dir,
                            struct error *err)
{
    struct landmark_map map;
    char path[PATH];

    snprintf(path, sizeof path, "%s/labels/mediapipe_to_ict.json", dir);
    if (landmark_map_read(&map, path, err))
        return -1;
    for (int k = 0; k < LANDMARK_FACE; k++) {
        size_t c = 0;
        while (c + 1 < a->face.nc && a->face.source[c] != map.vertex[k])
            c++;
        a->point[k] = (int32_t)c;
    }
    return 0;
}

/* The truth is told in the head's terms: its landmarks must lie on the scans'.
 */
static int scan_check_head(const struct scan_assets *a, const struct head *h,
                           struct error *err)
{
    float at[3 * HEAD_LANDMARKS], sum = 0;

    if (!h->has_landmarks || h->nshape < SCAN_IDENTITIES
        || h->nexp < ARKIT_COUNT)
        return error_set(err, EX_DATAERR, "head with %zu shapes and %zu "
                         "expressions%s (expected %d and %d at least, and "
                         "landmarks)", h->nshape, h->nexp,
                         h->has_landmarks ? "" : ", without landmarks",
                         SCAN_IDENTITIES, ARKIT_COUNT);
    head_landmarks(at, h, h->v_template);
    for (int k = 0; k < HEAD_LANDMARKS; k++) {
        float d[3];
        sub3(d, at + 3 * k, a->face.neutral + 3 * a->face.landmark[k]);
        sum += length3(d) / HEAD_LANDMARKS;
    }
    if (sum > 0.03f)
        return error_set(err, EX_DATAERR, "head whose landmarks lie %.1f mm "
                         "from the scans' (expected one registered to them: "
                         "head.safetensors)", (double)(sum * 200));
    return 0;
}

struct scan_assets *scan_open(const char *dir, const char *light,
                              const char *traits,
                              const struct head *head, struct error *err)
{
    struct scan_assets *a = calloc(1, sizeof *a);
    char path[PATH];
    int rc;

    if (!a)
        return error_null(err, EX_OSERR, "out of memory");
    struct arena *memory = &a->memory;

    snprintf(path, sizeof path, "%s/ict/ict.safetensors", dir);
    rc = traits_load(&a->traits, traits, err)
         || scan_face_load(&a->face, path, memory, err)
         || scan_check_head(a, head, err) || scan_find_labels(a, head, err)
         || scan_find_points(a, dir, err)
         || follow_map_init(&a->follow, &a->face, head, memory, err);
    snprintf(path, sizeof path, "%s/makehuman", dir);
    rc = rc || body_load(&a->body, &a->face, path, memory, err) ||
         scan_make_torso(a, err) || hand_make(&a->hand, &a->body, memory, err) ||
         scan_load_rack(&a->hair, a, dir, "hair", "_diffuse.png", NULL, -9,
                        err) ||
         scan_load_rack(&a->hat, a, dir, "clothes", NULL, "fedora01", -9,
                        err) ||
         scan_load_rack(&a->cloth, a, dir, "clothes", "_diffuse.png", NULL,
                        CLOTHES_MIN, err) ||
         scan_load_irises(a, dir, err) ||
         scan_load_lights(a, dir, light, err) ||
         sky_measure(a, err) ||
         skin_model_fit(&a->skin, &a->face, dir, memory, err) ||
         act_model_fit(&a->act, dir, err);
    if (rc) {
        scan_close(a);
        return NULL;
    }
    return a;
}

void scan_close(struct scan_assets *a)
{
    if (!a)
        return;
    arena_release(&a->memory);
    free(a);
}
