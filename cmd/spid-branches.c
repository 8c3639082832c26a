/* spid-branches: the three Gaussian branches (section 3.2 of the paper).
 * With --bake, an identity becomes an avatar; without, meshes move one. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli.h"
#include "lib/avatar/baked.h"
#include "lib/avatar/model.h"
#include "lib/avatar/prune.h"
#include "lib/avatar/records.h"
#include "lib/stream/stream.h"

static const char *bake_path, *avatar_path, *head_path;
static bool full, keep_clear;
static double prune_eps = -1, closed_mm = -1;
static unsigned without;
static enum nn_type precision = NN_F32;

static int parse_without(const char *value, void *dest, struct error *err)
{
    return avatar_without_list(dest, value, err);
}

static int parse_precision(const char *value, void *dest, struct error *err)
{
    if (nn_type_parse(dest, value) == 0)
        return 0;
    return error_set(err, EX_USAGE, "unknown precision (expected f32 or "
                     "bf16)");
}

static const struct cli_option options[] = {
    {"bake", 'b', CLI_STRING, &bake_path, 0, 0, "ID",
     "make an avatar of identity ID (\"-\": standard input)", NULL},
    {"avatar", 'i', CLI_STRING, &avatar_path, 0, 0, "FILE",
     "avatar to move", NULL},
    {"full", 0, CLI_FLAG, &full, 0, 0, NULL,
     "whole GAUS records instead of GMOV", NULL},
    {"without", 0, CLI_CALL, &without, 0, 0, "PART",
     "leave out dynamic, static, mouth, interp, deform or bend (commas)",
     parse_without},
    {"prune", 0, CLI_FLOAT, &prune_eps, 0, 1e6, "EPS",
     "with --bake: drop what no view shows above EPS", NULL},
    {"keep-clear", 0, CLI_FLAG, &keep_clear, 0, 0, NULL,
     "with --bake: keep Gaussians of opacity under 1/255", NULL},
    {"closed", 0, CLI_FLOAT, &closed_mm, 0, 100, "MM",
     "lips open less than this hide the mouth (default 0.5)", NULL},
    {"head", 0, CLI_STRING, &head_path, 0, 0, "FILE",
     "head model (default head.safetensors beside the model)", NULL},
    {"precision", 0, CLI_CALL, &precision, 0, 0, "TYPE",
     "f32 or bf16 inside the networks (default f32)", parse_precision},
    {0}
};

static const struct cli_usage usage = {
    "spid-branches", "[-b ID | -i FILE] [--full] [--without PART] "
    "[--prune EPS] [--keep-clear] [--closed MM] [--head FILE] "
    "[--precision TYPE] [-o FILE] [-j N] [-m MODEL] [-q] [--stats FILE] "
    "[STREAM]",
    "bake an avatar's Gaussians, or move them by driven meshes", options
};

static void note(const char *format, ...) __attribute__((format(printf, 1,
                                                                2)));
static void note(const char *format, ...)
{
    va_list ap;

    if (cli.quiet)
        return;
    va_start(ap, format);
    fputs("spid-branches: ", stderr);
    vfprintf(stderr, format, ap);
    fputc('\n', stderr);
    va_end(ap);
}

/* ---- Phase A ----------------------------------------------------------- */

struct bake {
    struct head head;
    struct avatar_model model;
    struct person person;
    struct baked baked;
    float *verts;
};

static void open_model(struct bake *k)
{
    struct error err = {0};
    char model[4096], head[4096];

    if (cli_find_model("model.safetensors", model, sizeof model, &err) ||
        (!head_path && cli_find_model("head.safetensors", head, sizeof head,
                                      &err)) ||
        head_load(&k->head, head_path ? head_path : head, &err) ||
        avatar_model_open(&k->model, model, &k->head, without, precision,
                          &err))
        die_error(&err);
    k->verts = malloc(3 * k->head.V * sizeof *k->verts);
    if (!k->verts)
        die(EX_OSERR, "no memory for %zu vertices", k->head.V);
}

/* Everything of the identity but old Gaussians goes on to the avatar. */
static void copy_identity(struct stream_writer *out, struct bake *k)
{
    struct error err = {0};
    struct record rec;
    int rc;

    struct stream_reader *in = stream_open(bake_path, NULL, &err);
    if (!in)
        die_error(&err);
    while ((rc = stream_read(in, &rec, &err)) > 0) {
        if (record_is(&rec, "GAUS") || record_is(&rec, "GMOV"))
            continue;
        if (person_take(&k->person, &rec, k->head.nexp, &err) < 0 ||
            stream_copy(out, &rec, &err)) {
            error_prefix(&err, "%s", stream_name(in));
            rc = -1;
            break;
        }
    }
    if (rc == 0 && !k->person.shape)
        rc = error_set(&err, EX_DATAERR, "%s: no SHAP record (expected an "
                       "identity, as spid-shape writes it)",
                       stream_name(in));
    stream_close(in);
    if (rc < 0) {
        stream_abandon(out);
        die_error(&err);
    }
}

static void prune(struct bake *k)
{
    const struct avatar *a = &k->model.avatar;
    struct prune_report r;
    struct error err = {0};
    struct identity id;

    if (!keep_clear) {
        size_t n = baked_drop_clear(&k->baked);
        note("%zu of %zu Gaussians are never drawn (opacity under 1/255)", n,
             n + k->baked.N);
    }
    if (prune_eps < 0)
        return;
    if (person_fold(&id, &k->head, &k->person, &err) ||
        prune_views(&k->baked, &r, &a->dense, &id, k->model.config.size,
                    prune_eps, &err))
        die_error(&err);
    identity_release(&id);
    note("pruned at %g over %zu views: dynamic %zu of %zu, static %zu of "
         "%zu, mouth %zu of %zu; worst view %.1f dB, largest difference "
         "%.2g; %.1f ms instead of %.1f", prune_eps, r.views, r.after[0],
         r.before[0], r.after[1], r.before[1], r.after[2], r.before[2],
         r.psnr, r.max_abs, r.ms_kept, r.ms_full);
}

static void bake(struct stream_writer *out)
{
    static struct bake k;
    struct error err = {0};

    open_model(&k);
    copy_identity(out, &k);
    double begun = stats_begin();
    if (avatar_model_bake(&k.model, k.verts, &k.person, &err) ||
        baked_from_avatar(&k.baked, &k.model.avatar, &err)) {
        stream_abandon(out);
        error_prefix(&err, "%s", bake_path);
        die_error(&err);
    }
    stats_end("bake", begun);
    const struct avatar *a = &k.model.avatar;
    note("%zu Gaussians; mouth: bowl %.2f mm, lip %.2f mm, cap %.2f mm, %zu "
         "clamped", k.baked.N, a->mouth.bowl / k.head.scale * 1e3,
         a->mouth.lip / k.head.scale * 1e3, a->cap / k.head.scale * 1e3,
         a->clamped);
    prune(&k);
    if (baked_write(out, 0, 0, &k.baked, NULL, NULL, &err)) {
        stream_abandon(out);
        die_error(&err);
    }
    baked_release(&k.baked);
    avatar_model_release(&k.model);
    person_release(&k.person);
    head_release(&k.head);
    free(k.verts);
}

/* ---- Phase B ----------------------------------------------------------- */

struct move {
    struct baked baked;
    struct densify dense;
    char head[17];          /* the avatar's CONF */
    struct baked_move frame;
    float *means;
    bool sent;              /* the baked GAUS */
};

static void take_hash(char hash[17], const struct record *rec)
{
    struct person p = {0};

    if (person_take(&p, rec, 0, NULL) == 1)
        memcpy(hash, p.head, 17);
}

/* Leave out branches and midpoints of an avatar that was baked with them. */
static void drop_branches(struct baked *b, size_t V)
{
    uint8_t *keep = malloc(b->N + 1);

    for (size_t i = 0; keep && i < b->N; i++)
        keep[i] = !(without >> b->branch[i] & 1) &&
                  !(without & WITHOUT_INTERP && i < b->dynamic &&
                    (size_t)b->vertex[i] >= V);
    if (keep)
        baked_keep(b, keep);
    if (without & WITHOUT_BEND)
        baked_straighten(b);
    free(keep);
}

static void open_avatar(struct move *m)
{
    struct error err = {0};
    struct record rec;
    int rc, found = 0;

    struct stream_reader *in = stream_open(avatar_path, NULL, &err);
    if (!in)
        die_error(&err);
    while (!found && (rc = stream_read(in, &rec, &err)) > 0) {
        if (record_is(&rec, "CONF"))
            take_hash(m->head, &rec);
        if (!record_is(&rec, "GAUS"))
            continue;
        if (baked_read(&m->baked, &rec, 0, &err)) {
            error_prefix(&err, "%s", avatar_path);
            die_error(&err);
        }
        found = 1;
    }
    if (!found && rc < 0)
        die_error(&err);
    if (!found)
        die(EX_DATAERR, "%s: no GAUS record (expected an avatar, as "
            "spid-branches --bake writes it)", avatar_path);
    stream_close(in);
}

/* The first mesh brings the faces: edges, and whether it fits the avatar. */
static int first_mesh(struct move *m, const struct record *rec,
                      struct error *err)
{
    size_t any[2] = {0, 3};
    const int32_t *f = record_get(rec, "faces", DTYPE_I32, 2, any, err);

    if (!f)
        return -1;
    size_t F = record_find(rec, "faces")->dim[0];
    size_t V = record_find(rec, "verts")->dim[0];
    for (size_t i = 0; i < 3 * F; i++)
        if (f[i] < 0 || (size_t)f[i] >= V)
            return error_set(err, EX_DATAERR, "MESH faces[%zu] is %d "
                             "(expected 0 to %zu)", i, f[i], V - 1);
    if (densify_init(&m->dense, f, F, V, err))
        return -1;
    drop_branches(&m->baked, V);
    for (size_t i = 0; i < m->baked.dynamic; i++)
        if ((size_t)m->baked.vertex[i] >= V + m->dense.E)
            return error_set(err, EX_DATAERR, "MESH has %zu vertices and %zu "
                             "edges (expected more than %d: the avatar "
                             "belongs to another head)", V, m->dense.E,
                             m->baked.vertex[i]);
    m->means = malloc((3 * m->baked.N + 1) * sizeof(float));
    if (!m->means)
        return error_set(err, EX_OSERR, "no memory for %zu Gaussians",
                         m->baked.N);
    return baked_move_init(&m->frame, &m->baked, err);
}

static int write_moved(struct stream_writer *out, struct move *m,
                       const struct record *rec, const float *cam,
                       struct error *err)
{
    static const char *const known[] = {"verts", "cam", "lip", "gap", "faces",
                                        NULL};
    static const int32_t first = 0;
    struct array a[STREAM_MAX_ARRAYS] = {
        array_make("cam", DTYPE_F32, cam, 2, 3, 4, 0, 0),
        array_make("first", DTYPE_I32, &first, 1, 1, 0, 0, 0),
        array_make("mean", DTYPE_F32, m->frame.mean, 2, m->baked.dynamic, 3,
                   0, 0),
        array_make("shift", DTYPE_F32, m->frame.shift, 1, 3, 0, 0, 0),
        array_make("body", DTYPE_F32, m->frame.body, 2, 3, 4, 0, 0)
    };

    if (full) {
        baked_means(m->means, &m->baked, &m->frame);
        return baked_write(out, rec->frame, rec->time, &m->baked, m->means,
                           cam, err);
    }
    if (!m->sent && baked_write(out, rec->frame, rec->time, &m->baked, NULL,
                                NULL, err))
        return -1;
    m->sent = true;
    int n = m->baked.bent ? 5 : 4;      /* nothing bends: no body */

    n += record_others(a + n, n, rec, known);
    return stream_write(out, "GMOV", rec->frame, rec->time, a, n, err);
}

/* mu_D = densified V_d, the mouth's shift, the camera T_d. */
static int move_frame(struct stream_writer *out, struct move *m,
                      const struct record *rec, struct error *err)
{
    size_t any[2] = {0, 3}, d34[2] = {3, 4}, d3[1] = {3}, d1[1] = {1};
    const float *verts = record_get(rec, "verts", DTYPE_F32, 2, any, err);
    const float *cam = verts ? record_get(rec, "cam", DTYPE_F32, 2, d34, err)
                             : NULL;
    const float *lip = cam ? record_get(rec, "lip", DTYPE_F32, 1, d3, err)
                           : NULL;
    const float *gap = NULL;

    if (!lip || record_check_finite(rec, err))
        return -1;
    if (record_find(rec, "gap") &&
        !(gap = record_get(rec, "gap", DTYPE_F32, 1, d1, err)))
        return -1;
    if (!m->means && first_mesh(m, rec, err))
        return -1;
    if (record_find(rec, "verts")->dim[0] != m->dense.V)
        return error_set(err, EX_DATAERR, "MESH has %zu vertices (expected "
                         "%zu, as the first one)",
                         record_find(rec, "verts")->dim[0], m->dense.V);
    double begun = stats_begin();
    /* MM at five units a metre: an unknown opening counts as open */
    float closed = closed_mm < 0 ? BAKED_CLOSED : (float)(closed_mm * 0.005);
    baked_drive(&m->frame, &m->baked, &m->dense, verts, lip, gap ? *gap : 1,
                closed, cam);
    stats_end("branches", begun);
    return write_moved(out, m, rec, cam, err);
}

static void check_head(const struct move *m, const struct record *rec)
{
    char hash[17] = "";

    take_hash(hash, rec);
    if (hash[0] && m->head[0] && strcmp(hash, m->head))
        die(EX_DATAERR, "%s: avatar belongs to head %s (expected %s, the "
            "stream's)", avatar_path, m->head, hash);
}

static void move(struct stream_writer *out, const char *input)
{
    static struct move m;
    struct error err = {0};
    struct record rec;
    int rc;

    open_avatar(&m);
    struct stream_reader *in = stream_open(input, NULL, &err);
    if (!in)
        die_error(&err);
    while ((rc = stream_read(in, &rec, &err)) > 0) {
        if (record_is(&rec, "CONF"))
            check_head(&m, &rec);
        if (record_is(&rec, "MESH") ? move_frame(out, &m, &rec, &err)
                                    : stream_copy(out, &rec, &err)) {
            error_prefix(&err, "%s: frame %llu", stream_name(in),
                         (unsigned long long)rec.frame);
            rc = -1;
            break;
        }
    }
    stream_close(in);
    if (rc < 0) {
        stream_abandon(out);
        die_error(&err);
    }
    baked_release(&m.baked);
    densify_release(&m.dense);
    baked_move_release(&m.frame);
    free(m.means);
}

static void check_options(int operands)
{
    if (!bake_path == !avatar_path)
        die(EX_USAGE, "%s (expected --bake ID to make an avatar, or "
            "-i FILE to move one)", bake_path ? "--bake and -i together"
            : "neither --bake nor -i");
    if (operands > (bake_path ? 0 : 1))
        die(EX_USAGE, "too many operands (expected %s)",
            bake_path ? "none with --bake" : "one stream");
    if (avatar_path && without & WITHOUT_DEFORM)
        die(EX_USAGE, "--without=deform: the avatar is baked already "
            "(expected with --bake)");
    if (avatar_path && (prune_eps >= 0 || keep_clear))
        die(EX_USAGE, "--prune and --keep-clear work at baking (expected "
            "with --bake)");
}

int main(int argc, char **argv)
{
    struct error err = {0};

    int first = cli_parse(&usage, argc, argv);
    check_options(argc - first);
    struct stream_writer *out = stream_create(cli.output, &err);
    if (!out)
        die_error(&err);
    if (bake_path)
        bake(out);
    else
        move(out, first < argc ? argv[first] : "-");
    if (stream_finish(out, &err))
        die_error(&err);
    stats_write();
    return 0;
}
