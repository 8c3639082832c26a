/* spid-export: every record of a stream to the files that were asked for: one
 * of each kind, or one per frame when the name has a number in it. */
#include "lib/export/export.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/obj.h"
#include "formats/pattern.h"
#include "formats/ply.h"
#include "formats/png.h"
#include "formats/splatfile.h"
#include "lib/base/camera.h"
#include "lib/head/mesh.h"

/* By enum export_kind: the option, and the records that it is made of where the
 * name may have one place for the frame's number. */
static const struct {
    const char *option, *record;
} kinds[EXPORT_KINDS] = {
    {"--ply", RECORD_GAUS}, {"--splat", RECORD_GAUS},
    {"--glb-splats", RECORD_GAUS}, {"--ply-compressed", RECORD_GAUS},
    {"--obj", RECORD_MESH}, {"--glb-head", NULL}, {"--html", NULL},
    {"--web", NULL}
};

/* ---- names -------------------------------------------------------------- */

/* The names of all files. */
static int export_check_names(const struct export_options *opt,
                              struct error *err)
{
    for (int k = 0; k < EXPORT_KINDS; k++) {
        const bool pattern = kinds[k].record;
        const int n = opt->file[k] ? pattern_count(opt->file[k]) : 0;

        if (n < 0 || n > pattern)
            return error_set(err, EX_USAGE, "%s=%s: bad file name (expected "
                             "%s)", kinds[k].option, opt->file[k],
                             pattern ? "at most one %d or %06d" : "no %");
    }
    return 0;
}

/* True when this frame goes into the file of that kind; path is then its
 * name. */
static bool export_wanted(char *path, size_t size, const struct export *x,
                          enum export_kind k, const struct record *rec)
{
    const char *name = x->opt.file[k];

    if (!name)
        return false;
    char *numbered = pattern_name(name, rec->frame);

    snprintf(path, size, "%s", numbered ? numbered : name);
    free(numbered);
    if (pattern_count(name) == 1)
        return true;
    return !x->done[k] &&
           (x->opt.frame < 0 || (size_t)x->opt.frame == rec->frame);
}

/* ---- Gaussians ---------------------------------------------------------- */

/* Head units per metre. */
static float export_head_scale(const struct export *x)
{
    return x->has_head ? x->head.scale : 5;
}

/* The scene as it is now. */
static int export_write_scene(const struct export *x, enum export_kind k,
                              const char *path, struct error *err)
{
    const struct gaussians *g = &x->scene.g;

    switch (k) {
    case EXPORT_PLY:
        return ply_write(path, g, !x->opt.model_space, err);
    case EXPORT_SPLAT:
        return splatfile_write(path, g, err);
    case EXPORT_GLB_SPLATS:
        return glb_write_splats(path, g, 1 / export_head_scale(x), err);
    default:
        return ply_write_packed(path, g, !x->opt.model_space, err);
    }
}

/* The same in every format that wants this frame. */
static int export_write_gaussians(struct export *x, const struct record *rec,
                                  struct error *err)
{
    char path[4096];

    for (int k = 0; k < DRAWN_FORMATS; k++) {
        if (!export_wanted(path, sizeof path, x, (enum export_kind)k, rec))
            continue;
        if (export_write_scene(x, (enum export_kind)k, path, err) ||
            drawn_compare(&x->drawn[k], (enum drawn_format)k, path, &x->scene,
                          !x->opt.model_space, export_head_scale(x), err))
            return -1;
        x->done[k] = true;
        x->files++;
        x->coarse |= x->scene.g.channels > 3;
    }
    return 0;
}

/* ---- the head ----------------------------------------------------------- */

/* The identity's mean head, once. */
static int export_fold(struct export *x, struct error *err)
{
    if (x->folded)
        return 0;
    if (person_fold(&x->id, &x->head, &x->person, err))
        return -1;
    x->folded = true;
    if (!x->opt.file[EXPORT_GLB_HEAD])
        return 0;
    return export_head_init(&x->skinned, &x->id, &x->opt.head, err);
}

/* The source picture becomes the texture once its motion is known. */
static int export_add_texture(struct export *x, struct error *err)
{
    struct person *p = &x->person;
    float cam[12], *verts = NULL;
    char *png = NULL;
    size_t bytes = 0;
    FILE *memory;
    int rc = -1;

    if (!p->rgb || !p->has_source || x->skinned.uv)
        return 0;
    verts = malloc(3 * x->head.V * sizeof *verts);
    memory = open_memstream(&png, &bytes);
    if (!verts || !memory) {
        error_set(err, EX_OSERR, "out of memory for the texture");
        goto out;
    }
    rc = png_write(memory, p->rgb, p->size, p->size, 3, err);
    fclose(memory);
    memory = NULL;
    if (rc)
        goto out;
    head_pose(verts, &x->id, &p->source.pose);
    motion_camera(cam, &p->source);
    rc = export_head_texture(&x->skinned, verts, cam, (uint8_t *)png, bytes,
                             err);
    png = NULL;
out:
    if (memory)
        fclose(memory);
    free(png);
    free(verts);
    return rc;
}

/* Our own mesh of the first frame, D (R v + t) as in export_head.c. */
static int export_keep_first(struct export *x, const struct export_motion *m,
                             struct error *err)
{
    const size_t V = x->head.V;
    float *verts = malloc(3 * V * sizeof *verts);

    x->shown = malloc(3 * V * sizeof *x->shown);
    if (!verts || !x->shown) {
        free(verts);
        return error_set(err, EX_OSERR, "out of memory for a mesh");
    }
    head_pose(verts, &x->id, &m->pose);
    for (size_t v = 0; v < V; v++) {
        float *to = x->shown + 3 * v;

        camera_apply(to, m->cam, verts + 3 * v);
        for (int i = 0; i < 3; i++)
            to[i] *= (i ? -1 : 1) / x->head.scale;
    }
    free(verts);
    return 0;
}

/* One MOTN record: a frame of the animated head. */
static int export_take_motion(struct export *x, const struct record *rec,
                              struct error *err)
{
    struct motion m;
    struct export_motion e = {.time = rec->time};

    if (motion_read(&m, rec, x->head.nexp, err) || export_fold(x, err) ||
        export_add_texture(x, err))
        return -1;
    e.pose = m.pose;
    motion_camera(e.cam, &m);
    if (export_head_frame(&x->skinned, &e, err) ||
        (!x->shown && export_keep_first(x, &e, err)))
        return -1;
    x->frames++;
    return 0;
}

/* One MESH record, in metres, with normals. */
static int export_write_obj(struct export *x, const struct record *rec,
                            struct error *err)
{
    struct mesh mesh;
    char path[4096];
    int rc = -1;

    if (!export_wanted(path, sizeof path, x, EXPORT_OBJ, rec))
        return 0;
    if (mesh_read(&mesh, rec, err))
        return -1;
    if (mesh.V != x->head.V)
        return error_set(err, EX_DATAERR, "MESH has %zu vertices (expected "
                         "%zu, the head's)", mesh.V, x->head.V);
    float *metres = malloc(6 * x->head.V * sizeof *metres);
    if (metres) {
        for (size_t i = 0; i < 3 * x->head.V; i++)
            metres[i] = mesh.verts[i] / x->head.scale;
        head_normals(metres + 3 * x->head.V, &x->head, metres);
        rc = obj_write(path, metres, metres + 3 * x->head.V, x->head.V,
                       x->head.f, x->head.F, err);
    } else {
        error_set(err, EX_OSERR, "out of memory for a mesh");
    }
    x->done[EXPORT_OBJ] = true;
    x->files++;
    free(metres);
    return rc;
}

/* ---- records in, files out ---------------------------------------------- */

bool export_needs_head(const struct export_options *opt)
{
    return opt->file[EXPORT_OBJ] || opt->file[EXPORT_GLB_HEAD] ||
           opt->file[EXPORT_HTML] || opt->file[EXPORT_WEB];
}

int export_init(struct export *x, const struct export_options *opt,
                const char *head_path, struct error *err)
{
    memset(x, 0, sizeof *x);
    x->opt = *opt;
    if (export_check_names(opt, err))
        return -1;
    if (!export_needs_head(opt))
        return 0;
    if (head_load(&x->head, head_path, err))
        return -1;
    x->has_head = true;
    page_init(&x->page, x->head.nexp);
    return 0;
}

/* Whether what a page has is wanted. */
static bool export_has_page(const struct export *x)
{
    return x->opt.file[EXPORT_HTML] || x->opt.file[EXPORT_WEB];
}

int export_load_identity(struct export *x, const char *path,
                         struct error *err)
{
    if (person_load(&x->person, path, x->head.nexp, err))
        return -1;
    return export_has_page(x) ? page_load_avatar(&x->page, path, err) : 0;
}

void export_release(struct export *x)
{
    export_head_release(&x->skinned);
    identity_release(&x->id);
    person_release(&x->person);
    scene_release(&x->scene);
    page_release(&x->page);
    head_release(&x->head);
    free(x->shown);
}

int export_record(struct export *x, const struct record *rec,
                  struct error *err)
{
    int change = scene_apply(&x->scene, rec, err);

    /* before any mesh or Gaussian, MOTN beside SRCI is the source's own */
    bool own = record_is(rec, RECORD_MOTN) && x->person.rgb &&
               !x->person.has_source;

    if (change < 0 || (export_has_page(x) && !own && page_record(&x->page, rec, err)))
        return -1;
    if (change != SCENE_NONE)
        return export_write_gaussians(x, rec, err);
    if (!x->has_head)
        return 0;
    int taken = 0;
    if (own || !record_is(rec, RECORD_MOTN))
        taken = person_read_record(&x->person, rec, x->head.nexp, err);
    if (taken)
        return taken < 0 ? -1 : 0;
    if (record_is(rec, RECORD_MOTN) && x->opt.file[EXPORT_GLB_HEAD])
        return export_take_motion(x, rec, err);
    if (record_is(rec, RECORD_MESH) && x->opt.file[EXPORT_OBJ])
        return export_write_obj(x, rec, err);
    return 0;
}

int export_finish(struct export *x, struct error *err)
{
    const char *const *file = x->opt.file;

    if (file[EXPORT_GLB_HEAD]) {
        if (export_fold(x, err) || export_add_texture(x, err) ||
            export_head_write(&x->skinned, file[EXPORT_GLB_HEAD], err) ||
            drawn_head_compare(&x->drawn_head, file[EXPORT_GLB_HEAD],
                               x->shown ? x->shown : x->skinned.position,
                               &x->head, err))
            return -1;
        x->files++;
    }
    for (int k = EXPORT_HTML; k <= EXPORT_WEB; k++) {
        const bool page = k == EXPORT_HTML;

        if (!file[k])
            continue;
        if (export_fold(x, err) ||
            page_write(&x->page, file[k], page ? x->opt.player : NULL, &x->id,
                       &x->person, page ? &x->page_bytes : NULL, err))
            return -1;
        x->files++;
    }
    for (int k = 0; k < EXPORT_KINDS; k++)
        if (file[k] && kinds[k].record && !x->done[k])
            return error_set(err, EX_DATAERR, "nothing for %s in this stream "
                             "(expected %s records, of the frame chosen if "
                             "any)", kinds[k].option, kinds[k].record);
    return 0;
}
