/* The head's tensors from one file and into another, and the metadata that say
 * what it is. */
#include "lib/lab/head/template.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/base/half.h"
#include "lib/head/arkit.h"
#include "lib/head/runs.h"
#include "lib/lab/head/scan.h"

/* Metres: what a direction moves by less than this it does not move. */
#define DELTA_MIN 2e-6

/* A tensor and where it stands in the struct, in the order of the file; what
 * may be packed or halved has its own code. */
struct field {
    const char *name;
    size_t at;                  /* of the pointer */
    bool integer;
    size_t count;               /* of the size, for what may be any length */
    size_t dim[3];              /* 0: the size; VERTICES: of them */
};
#define VERTICES ((size_t)TEMPLATE_VERTICES)
#define AT(name) offsetof(struct template, name)
static const struct field mesh[] = {
    { "v_template", AT(v_template), 0, 0, { VERTICES, 3 } },
    { "f", AT(f), 1, AT(nf), { 0, 3 } },
};
static const struct field rig[] = {
    { "J_regressor", AT(j_regressor), 0, 0, { TEMPLATE_JOINTS, VERTICES } },
    { "weights", AT(weights), 0, 0, { VERTICES, TEMPLATE_JOINTS } },
    { "parents", AT(parents), 1, 0, { TEMPLATE_JOINTS } },
    { "l_eyelid", AT(l_eyelid), 0, 0, { VERTICES, 3 } },
    { "r_eyelid", AT(r_eyelid), 0, 0, { VERTICES, 3 } },
    { "lip_inner", AT(lip_inner), 1, AT(nlip_inner), { 0 } },
    { "lip_upper_outer", AT(lip_upper_outer), 1, AT(nlip_upper_outer), { 0 } },
    { "landmark_faces", AT(landmark_face), 1, 0, { TEMPLATE_LANDMARKS } },
    { "landmark_bary", AT(landmark_bary), 0, 0, { TEMPLATE_LANDMARKS, 3 } },
    { "region", AT(region), 1, 0, { VERTICES } },
    { "hair", AT(hair), 0, 0, { VERTICES } },
    { "uv", AT(uv), 0, 0, { VERTICES, 2 } },
};
static const struct field lids[] = {
    { "lid_vertices", AT(lid_vertices), 1, AT(nlid), { 0 } },
    { "lid_sides", AT(lid_sides), 1, AT(nlid), { 0 } },
    { "lid_shapedirs", AT(lid_shapedirs), 0, AT(nlid),
      { 0, 3, TEMPLATE_LID_SHAPES } },
};
#define COUNT(list) (sizeof(list) / sizeof *(list))

static int field_dims(const struct field *f)
{
    return f->dim[2] ? 3 : f->dim[1] ? 2 : 1;
}

/* ---- reading ------------------------------------------------------------ */

static int template_read(struct template *t, const struct safetensors *st,
                         const struct field *list, size_t n, struct error *err)
{
    for (size_t i = 0; i < n; i++) {
        const struct field *f = &list[i];
        const int ndim = field_dims(f);
        char *at = (char *)t + f->at;
        size_t count, rows = 1;
        void *x = f->integer
            ? (void *)st_load_i32(st, f->name, ndim, f->dim, &count, err)
            : (void *)st_load_f32(st, f->name, ndim, f->dim, &count, err);

        x = arena_keep(&t->memory, x, err);
        if (!x)
            return -1;
        memcpy(at, &x, sizeof x);
        for (int k = 1; k < ndim; k++)
            rows *= f->dim[k];
        if (f->count)
            *(size_t *)((char *)t + f->count) = count / rows;
    }
    return 0;
}

float *template_directions(const struct safetensors *st, const char *name,
                           size_t V, size_t K, struct error *err)
{
    char runs[64], values[64];
    size_t dims[3] = { V, 3, K }, two[2] = { 0, 3 }, n, rows;
    float *out = NULL;

    snprintf(runs, sizeof runs, "%s_runs", name);
    snprintf(values, sizeof values, "%s_values", name);
    if (!st_find(st, runs))
        return st_load_f32(st, name, 3, dims, NULL, err);
    int32_t *run = st_load_i32(st, runs, 2, two, &n, err);
    const void *value = run ? st_borrow_f16(st, values, 2, two, &rows, err)
                            : NULL;
    if (value)
        out = runs_unpack(&(struct runs_read){ run, n / 3, value, rows / 3,
                                               V, K }, err);
    free(run);
    return out;
}

int template_load(struct template *t, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = -1;

    *t = (struct template){ .nv = VERTICES };
    if (st && !template_read(t, st, mesh, COUNT(mesh), err) &&
        (t->shapedirs = arena_keep(&t->memory, template_directions(
             st, "shapedirs", VERTICES, TEMPLATE_DIRECTIONS, err), err)) &&
        (t->posedirs = arena_keep(&t->memory, template_directions(
             st, "posedirs", VERTICES, TEMPLATE_POSES, err), err)) &&
        !template_read(t, st, rig, COUNT(rig), err))
        rc = template_read(t, st, lids, COUNT(lids), err);
    st_close(st);
    if (rc)
        template_release(t);
    return rc;
}

void template_release(struct template *t)
{
    arena_release(&t->memory);
    *t = (struct template){ 0 };
}

/* ---- writing ------------------------------------------------------------ */

/* The file's tensors, in the order of the file. */
struct save_list {
    struct st_tensor tensor[24];
    size_t count;
};

/* One more, of up to three dimensions; those that are 0 are left out. */
static void template_add(struct save_list *l, const char *name,
                         enum st_dtype type, const void *data, size_t a,
                         size_t b, size_t c)
{
    l->tensor[l->count++] = (struct st_tensor){
        .name = name, .dtype = type, .data = data,
        .ndim = c ? 3 : b ? 2 : 1, .dim = { a, b, c },
        .count = a * (b ? b : 1) * (c ? c : 1)
    };
}

static void template_add_fields(struct save_list *l, const struct template *t,
                                const struct field *list, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const struct field *f = &list[i];
        void *x;
        size_t rows = f->dim[0] ? f->dim[0]
                    : *(const size_t *)((const char *)t + f->count);

        memcpy(&x, (const char *)t + f->at, sizeof x);
        template_add(l, f->name, f->integer ? ST_I32 : ST_F32, x, rows,
                     f->dim[1], f->dim[2]);
    }
}

/* Directions as FLAME has them, or as runs. */
static void template_add_directions(struct save_list *l,
                                    const struct template *t,
                                    const struct runs *shape,
                                    const struct runs *pose)
{
    if (!shape->run) {
        template_add(l, "shapedirs", ST_F32, t->shapedirs, t->nv, 3,
                     TEMPLATE_DIRECTIONS);
        template_add(l, "posedirs", ST_F32, t->posedirs, t->nv, 3,
                     TEMPLATE_POSES);
        return;
    }
    template_add(l, "shapedirs_runs", ST_I32, shape->run, shape->n, 3, 0);
    template_add(l, "shapedirs_values", ST_F16, shape->value, shape->rows, 3,
                 0);
    template_add(l, "posedirs_runs", ST_I32, pose->run, pose->n, 3, 0);
    template_add(l, "posedirs_values", ST_F16, pose->value, pose->rows, 3, 0);
}

/* What a head made from the scans says of itself. */
static const char source[] =
    "registered to ICT-FaceKit (Light), USC Institute for Creative "
    "Technologies: identities 0-99 and expressions 0-52 are its shapes";
static const char licence[] =
    "Derived from ICT-FaceKit. MIT License. Copyright (c) 2020 USC Institute "
    "for Creative Technologies. Permission is hereby granted, free of charge, "
    "to any person obtaining a copy of this software and associated "
    "documentation files (the \"Software\"), to deal in the Software without "
    "restriction, including without limitation the rights to use, copy, "
    "modify, merge, publish, distribute, sublicense, and/or sell copies of "
    "the Software, and to permit persons to whom the Software is furnished to "
    "do so, subject to the following conditions: The above copyright notice "
    "and this permission notice shall be included in all copies or "
    "substantial portions of the Software. THE SOFTWARE IS PROVIDED \"AS "
    "IS\", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT "
    "NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A "
    "PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR "
    "COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, "
    "WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT "
    "OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN "
    "THE SOFTWARE.";

/* Where the scans lie in the head's metres, and the angles at which the ARKit
 * shapes that turn a joint are fully on, as JSON. */
static void template_places(char *place, size_t room, char *angles,
                               size_t angle_room)
{
    snprintf(place, room, "{\"scale\":%g,\"shift\":[%g,%g,%g]}",
             SCAN_SCALE, SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z);
    snprintf(angles, angle_room, "{\"jawOpen\":%.9g,\"jawLeft\":%.9g,"
             "\"eyeLookUp\":%.9g,\"eyeLookDown\":%.9g,\"eyeLookIn\":%.9g,"
             "\"eyeLookOut\":%.9g}", ARKIT_JAW_OPEN, ARKIT_JAW_SIDE,
             ARKIT_EYE_UP, ARKIT_EYE_DOWN, ARKIT_EYE_IN, ARKIT_EYE_OUT);
}

int template_save(const struct template *t, const char *path, bool plain,
                  struct error *err)
{
    char names[ARKIT_NAMES], place[160], angles[256];
    const char *const meta[] = { "format", "spid-head", "scale", "5",
        "nshape", "300", "nexp", "100", "unit", "metre",
        "expression_names", names, "identity", "0-99: ICT-FaceKit's weights, "
        "standard normal; 100-123: skull and neck, standard normal; rest 0",
        "scan_to_metres", place, "arkit_angles", angles,
        "source", source, "licence", licence, NULL };
    struct runs shape = {0}, pose = {0};
    struct save_list l = {.count = 0};
    int rc = -1;

    arkit_names(names);
    template_places(place, sizeof place, angles, sizeof angles);
    size_t n = 3 * t->nlid * TEMPLATE_LID_SHAPES;
    uint16_t *lid = malloc((n + 1) * sizeof *lid);

    if (!lid)
        return error_set(err, EX_OSERR, "no memory to save a head");
    for (size_t i = 0; i < n; i++)
        lid[i] = float_to_half(t->lid_shapedirs[i]);
    if (!plain &&
        (runs_pack(&shape, t->shapedirs, t->nv, TEMPLATE_DIRECTIONS, DELTA_MIN,
                   err) ||
         runs_pack(&pose, t->posedirs, t->nv, TEMPLATE_POSES, DELTA_MIN, err)))
        goto out;
    template_add_fields(&l, t, mesh, COUNT(mesh));
    template_add_directions(&l, t, &shape, &pose);
    template_add_fields(&l, t, rig, COUNT(rig));
    template_add_fields(&l, t, lids, COUNT(lids) - 1);
    template_add(&l, "lid_shapedirs", ST_F16, lid, t->nlid, 3,
                 TEMPLATE_LID_SHAPES);
    rc = st_save(path, l.tensor, l.count, meta, err);
out:
    free(lid);
    runs_release(&shape);
    runs_release(&pose);
    return rc;
}
