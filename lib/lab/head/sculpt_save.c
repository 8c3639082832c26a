/* The sculpted head as a file: every array of it under the name that spid-
 * head(1) gives, and the metadata that say what it is. */
#include "lib/base/half.h"
#include "lib/lab/head/sculpt.h"

#include <stdio.h>
#include <stdlib.h>
#include <sysexits.h>

#include "formats/safetensors.h"
#include "lib/head/arkit.h"
#include "lib/head/runs.h"
#include "lib/lab/head/scan.h"

/* Metres: what a direction moves by less than this it does not move. */
#define LEAST 2e-6

/* The file's tensors, in the order of the file. */
struct save_list {
    struct st_tensor tensor[24];
    size_t count;
};

/* One more, of up to three dimensions; those that are 0 are left out. */
static void sculpt_save_add(struct save_list *l, const char *name,
                            enum st_dtype type, const void *data, size_t a,
                            size_t b, size_t c)
{
    l->tensor[l->count++] = (struct st_tensor){
        .name = name, .dtype = type, .data = data,
        .ndim = c ? 3 : b ? 2 : 1, .dim = { a, b, c },
        .count = a * (b ? b : 1) * (c ? c : 1)
    };
}

/* The mesh, which comes before its directions ... */
static void sculpt_save_mesh(struct save_list *l, const struct sculpt *s)
{
    sculpt_save_add(l, "v_template", ST_F32, s->v_template, s->nv, 3, 0);
    sculpt_save_add(l, "f", ST_I32, s->f, s->nf, 3, 0);
}

/* ... and what follows them: rig, lip rings, landmarks, regions. */
static void sculpt_save_rig(struct save_list *l, const struct sculpt *s)
{
    const size_t V = s->nv, J = SCULPT_JOINTS, L = SCULPT_LANDMARKS;

    sculpt_save_add(l, "J_regressor", ST_F32, s->j_regressor, J, V, 0);
    sculpt_save_add(l, "weights", ST_F32, s->weights, V, J, 0);
    sculpt_save_add(l, "parents", ST_I32, s->parents, J, 0, 0);
    sculpt_save_add(l, "l_eyelid", ST_F32, s->l_eyelid, V, 3, 0);
    sculpt_save_add(l, "r_eyelid", ST_F32, s->r_eyelid, V, 3, 0);
    sculpt_save_add(l, "lip_inner", ST_I32, s->lip_inner, s->n_lip_inner, 0, 0);
    sculpt_save_add(l, "lip_upper_outer", ST_I32, s->lip_upper_outer,
                    s->n_lip_upper_outer, 0, 0);
    sculpt_save_add(l, "landmark_faces", ST_I32, s->landmark_face, L, 0, 0);
    sculpt_save_add(l, "landmark_bary", ST_F32, s->landmark_bary, L, 3, 0);
    sculpt_save_add(l, "region", ST_I32, s->region, V, 0, 0);
    sculpt_save_add(l, "hair", ST_F32, s->hair, V, 0, 0);
    sculpt_save_add(l, "uv", ST_F32, s->uv, V, 2, 0);
}

void sculpt_arrays(struct head_arrays *a, const struct sculpt *s)
{
    *a = (struct head_arrays){
        .V = s->nv, .F = s->nf, .nshape = SCULPT_SHAPES,
        .nexp = SCULPT_EXPRESSIONS, .v_template = s->v_template, .f = s->f,
        .shapedirs = s->shapedirs, .posedirs = s->posedirs,
        .J_regressor = s->j_regressor, .weights = s->weights,
        .parents = s->parents, .l_eyelid = s->l_eyelid,
        .r_eyelid = s->r_eyelid, .lip_inner = s->lip_inner,
        .lip_upper_outer = s->lip_upper_outer,
        .nlip_inner = s->n_lip_inner,
        .nlip_upper_outer = s->n_lip_upper_outer,
        .landmark_faces = s->landmark_face,
        .landmark_bary = s->landmark_bary, .region = s->region,
        .hair = s->hair, .uv = s->uv, .nlid = s->n_lid,
        .nlid_shape = s->n_lid ? SCULPT_LID_SHAPES : 0,
        .lid_vertices = s->lid_vertices, .lid_sides = s->lid_sides,
        .lid_shapedirs = s->lid_shapedirs,
    };
}

/* The names of the ARKit shapes as a JSON list. */
static void sculpt_save_names(char *out, size_t room)
{
    size_t n = (size_t)snprintf(out, room, "[");

    for (int k = 0; k < ARKIT_COUNT && n < room; k++)
        n += (size_t)snprintf(out + n, room - n, "%s\"%s\"", k ? "," : "",
                              arkit_name(k));
    if (n < room)
        snprintf(out + n, room - n, "]");
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
static void sculpt_save_places(char *place, size_t room, char *angles,
                               size_t angle_room)
{
    snprintf(place, room, "{\"scale\":%g,\"shift\":[%g,%g,%g]}",
             SCAN_SCALE, SCAN_SHIFT_X, SCAN_SHIFT_Y, SCAN_SHIFT_Z);
    snprintf(angles, angle_room, "{\"jawOpen\":%.9g,\"jawLeft\":%.9g,"
             "\"eyeLookUp\":%.9g,\"eyeLookDown\":%.9g,\"eyeLookIn\":%.9g,"
             "\"eyeLookOut\":%.9g}", ARKIT_JAW_OPEN, ARKIT_JAW_SIDE,
             ARKIT_EYE_UP, ARKIT_EYE_DOWN, ARKIT_EYE_IN, ARKIT_EYE_OUT);
}

int sculpt_save_scans(const struct sculpt *s, const char *path,
                      struct error *err)
{
    char names[2048], place[160], angles[256];
    const char *const meta[] = { "format", "spid-head", "scale", "5",
        "nshape", "300", "nexp", "100", "unit", "metre",
        "expression_names", names, "identity", "0-99: ICT-FaceKit's weights, "
        "standard normal; 100-123: skull and neck, standard normal; rest 0",
        "scan_to_metres", place, "arkit_angles", angles,
        "source", source, "licence", licence, NULL };
    size_t V = s->nv;
    struct runs shape = {0}, pose = {0};
    struct save_list l = {.count = 0};
    int rc = -1;

    sculpt_save_names(names, sizeof names);
    sculpt_save_places(place, sizeof place, angles, sizeof angles);
    size_t n = 3 * s->n_lid * SCULPT_LID_SHAPES;
    uint16_t *lid = malloc((n + 1) * sizeof *lid);

    if (!lid)
        return error_set(err, EX_OSERR, "no memory to save a head");
    for (size_t i = 0; i < n; i++)
        lid[i] = float_to_half(s->lid_shapedirs[i]);
    if (runs_pack(&shape, s->shapedirs, V, SCULPT_SHAPES + SCULPT_EXPRESSIONS,
                  LEAST, err) ||
        runs_pack(&pose, s->posedirs, V, SCULPT_POSES, LEAST, err))
        goto out;
    sculpt_save_mesh(&l, s);
    sculpt_save_add(&l, "shapedirs_runs", ST_I32, shape.run, shape.n, 3, 0);
    sculpt_save_add(&l, "shapedirs_values", ST_F16, shape.value, shape.rows, 3,
                    0);
    sculpt_save_add(&l, "posedirs_runs", ST_I32, pose.run, pose.n, 3, 0);
    sculpt_save_add(&l, "posedirs_values", ST_F16, pose.value, pose.rows, 3, 0);
    sculpt_save_rig(&l, s);
    sculpt_save_add(&l, "lid_vertices", ST_I32, s->lid_vertices, s->n_lid, 0,
                    0);
    sculpt_save_add(&l, "lid_sides", ST_I32, s->lid_sides, s->n_lid, 0, 0);
    sculpt_save_add(&l, "lid_shapedirs", ST_F16, lid, s->n_lid, 3,
                    SCULPT_LID_SHAPES);
    rc = st_save(path, l.tensor, l.count, meta, err);
out:
    free(lid);
    runs_release(&shape);
    runs_release(&pose);
    return rc;
}

int sculpt_save(const struct sculpt *s, const char *path, struct error *err)
{
    static const char *const meta[] = { "format", "spid-head", "scale", "5",
        "nshape", "300", "unit", "metre", NULL };
    struct save_list l = {.count = 0};

    sculpt_save_mesh(&l, s);
    sculpt_save_add(&l, "shapedirs", ST_F32, s->shapedirs, s->nv, 3,
                    SCULPT_SHAPES + SCULPT_EXPRESSIONS);
    sculpt_save_add(&l, "posedirs", ST_F32, s->posedirs, s->nv, 3,
                    SCULPT_POSES);
    sculpt_save_rig(&l, s);
    return st_save(path, l.tensor, l.count, meta, err);
}
