/* spid-flame: motion parameters in, driven head meshes out.  Eqs. M, T_d and
 * V_d of the paper. */
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "lib/head/lbs.h"
#include "lib/head/mesh.h"
#include "lib/head/person.h"
#include "lib/stream/stream.h"

static const char *head_path, *identity_path;
static bool keep_motion;

static const struct cli_option options[] = {
    OPTION_STRING("identity", 'i', &identity_path, "FILE",
                  "take the shape from this identity's SHAP record"),
    OPTION_HEAD(&head_path),
    OPTION_FLAG("keep-motion", 0, &keep_motion,
                "pass each MOTN record on in front of its MESH"),
    {0}
};

static const struct cli_usage usage = {
    "spid-flame", "[OPTION ...] [STREAM]",
    "pose the head model for every MOTN record", options
};

struct flame {
    struct stream_writer *out;
    struct head head;
    struct identity id;
    struct person person;
    float *verts;
    int meshes;             /* written so far: the first has the faces */
};

/* The head model, and room for its vertices. */
static void flame_open_head(struct flame *f, const char *path)
{
    struct error err = {0};

    if (option_head_load(&f->head, path, &err))
        die_error(&err);
    f->verts = malloc(3 * f->head.V * sizeof *f->verts);
    if (!f->verts)
        die(EX_OSERR, "no memory for %zu vertices", f->head.V);
}

/* beta into the template: of the identity file, or of the stream so far; the
 * mean head without either. */
static void flame_fold_identity(struct flame *f)
{
    struct error err = {0};

    identity_release(&f->id);
    if (person_fold(&f->id, &f->head, &f->person, &err)) {
        if (identity_path)
            error_prefix(&err, "%s", identity_path);
        die_error(&err);
    }
}

/* Shape coefficients of an identity stream; without one the mean head. */
static void flame_open_identity(struct flame *f, const char *path)
{
    struct error err = {0};

    if (path && person_load(&f->person, path, f->head.nexp, &err))
        die_error(&err);
    flame_fold_identity(f);
}

/* The line that is this program: V_d and T_d of one frame. */
static int flame_write_mesh(struct flame *f, const struct record *rec,
                            struct error *err)
{
    static const char *const known[] = {"rot", "trans", "exp", "jaw", "lid",
                                        "eye", "crop", NULL};
    struct array others[STREAM_MAX_ARRAYS];
    struct motion m;
    float cam[12];

    if (motion_read(&m, rec, f->head.nexp, err))
        return -1;
    double begun = stats_begin();
    head_pose(f->verts, &f->id, &m.pose);
    motion_camera(cam, &m);
    stats_end("flame", begun);
    if (keep_motion && stream_copy(f->out, rec, err))
        return -1;
    int n = record_others(others, 4, rec, known);
    return mesh_write(f->out, rec->frame, rec->time, &f->head, f->verts, cam,
                      f->meshes++ == 0, others, n, err);
}

/* One record of the input; -1 and *err when it is damaged or cannot be
 * written. */
static int flame_pass_record(const struct record *rec, void *flame,
                             struct error *err)
{
    struct flame *f = flame;

    if (record_is(rec, RECORD_MOTN))
        return flame_write_mesh(f, rec, err);
    if (!identity_path &&
        (record_is(rec, RECORD_SHAP) || record_is(rec, RECORD_CONF))) {
        int taken = person_read_record(&f->person, rec, f->head.nexp, err);

        if (taken < 0)
            return -1;
        if (record_is(rec, RECORD_SHAP))
            flame_fold_identity(f);
    }
    return stream_copy(f->out, rec, err);
}

int main(int argc, char **argv)
{
    struct flame f = {0};
    struct error err = {0};

    int first = cli_parse_stage(&usage, argc, argv, false);
    const char *input = cli_stream_operand(first, argc, argv);
    flame_open_head(&f, head_path);
    flame_open_identity(&f, identity_path);
    struct stream_reader *in = stream_open(input, NULL, &err);
    if (!in)
        die_error(&err);
    f.out = cli_create_stream(cli.output);
    if (stream_each(in, flame_pass_record, &f, &err))
        cli_abandon_stream(f.out, &err);
    if (stream_finish(f.out, &err))
        die_error(&err);
    stats_write();
    stream_close(in);
    person_release(&f.person);
    identity_release(&f.id);
    head_release(&f.head);
    free(f.verts);
    return 0;
}
