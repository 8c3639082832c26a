/* spid-branches: the three Gaussian branches (section 3.2 of the paper).
 * With --bake, an identity becomes an avatar; without, meshes move one. */
#include <stdlib.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "lib/avatar/baked.h"
#include "lib/avatar/baker.h"
#include "lib/avatar/mover.h"
#include "lib/avatar/prune.h"
#include "lib/avatar/target_light.h"
#include "lib/head/person.h"
#include "lib/net/config.h"
#include "lib/stream/records.h"
#include "lib/stream/stream.h"

static const char *bake_path, *avatar_path, *head_path;
static bool full;
static double prune_eps = -1;
static unsigned without;
static struct target_light light;
static enum nn_type precision = OPTION_PRECISION_DEFAULT;

/* Bits of enum avatar_without. */
static int branches_parse_without(const char *value, void *dest,
                                  struct error *err)
{
    return option_words(dest, value, avatar_config_parts + 1, err);
}

static const struct cli_option options[] = {
    OPTION_STRING("bake", 'b', &bake_path, "ID",
                  "make an avatar of identity ID (\"-\": standard input)"),
    OPTION_STRING("avatar", 'i', &avatar_path, "FILE", "avatar to move"),
    OPTION_FLAG("full", 0, &full, "whole GAUS records instead of GMOV"),
    OPTION_CALL("without", 0, &without, "PART", branches_parse_without,
                "leave out dynamic, static, mouth, interp, deform or neck "
                "(commas)"),
    OPTION_FLOAT("prune", 0, &prune_eps, 0, 1e6, "EPS",
                 "with --bake: drop what no view shows above EPS"),
    OPTION_LIGHT(&light),
    OPTION_HEAD(&head_path),
    OPTION_PRECISION(&precision, "networks"),
    {0}
};

static const struct cli_usage usage = {
    "spid-branches", "[-b ID | -i FILE] [OPTION ...] [STREAM]",
    "bake an avatar's Gaussians, or move them by driven meshes", options
};

/* ---- Phase A ----------------------------------------------------------- */

struct bake {
    struct stream_writer *out;
    struct head head;
    struct baker baker;
    struct person person;
    struct baked baked;
    float *verts;
};

/* Networks and head. */
static void branches_open_model(struct bake *k)
{
    const struct baker_options opt = {.without = without, .type = precision};
    struct error err = {0};
    struct model model;

    if (option_model_open(&model, &err) ||
        option_head_load(&k->head, head_path, &err) ||
        baker_open(&k->baker, &model, &k->head, &opt, &err))
        die_error(&err);
    model_close(&model);
    k->verts = malloc(3 * k->head.V * sizeof *k->verts);
    if (!k->verts)
        die(EX_OSERR, "no memory for %zu vertices", k->head.V);
}

/* A record of the identity, which goes on to the avatar unless it is old
 * Gaussians. */
static int branches_copy_record(const struct record *rec, void *bake,
                                struct error *err)
{
    struct bake *k = bake;

    if (record_is(rec, RECORD_GAUS) || record_is(rec, RECORD_GMOV))
        return 0;
    return person_read_record(&k->person, rec, k->head.nexp, err) < 0 ||
           stream_copy(k->out, rec, err) ? -1 : 0;
}

/* All of it. */
static void branches_copy_identity(struct bake *k)
{
    struct error err = {0};
    int rc = stream_load(bake_path, branches_copy_record, k, &err);

    if (rc == 0 && !k->person.shape)
        rc = error_set(&err, EX_DATAERR, "%s: no SHAP record (expected an "
                       "identity, as spid-shape writes it)", bake_path);
    if (rc)
        cli_abandon_stream(k->out, &err);
}

/* Leave out what is never drawn, and by --prune what hardly is. */
static void branches_prune_avatar(struct bake *k)
{
    struct prune_report r;
    struct error err = {0};
    struct identity id;
    struct densify dense;

    const size_t n = baked_drop_clear(&k->baked);
    notice("%zu of %zu Gaussians are never drawn (opacity under 1/255)", n,
           n + k->baked.N);
    if (prune_eps < 0)
        return;
    if (person_fold(&id, &k->head, &k->person, &err) ||
        densify_init(&dense, k->head.f, k->head.F, k->head.V, &err) ||
        prune_views(&k->baked, &r, &dense, &id, k->baker.config.size,
                    prune_eps, &err))
        die_error(&err);
    identity_release(&id);
    densify_release(&dense);
    notice("pruned at %g over %zu views: dynamic %zu of %zu, static %zu of "
           "%zu, mouth %zu of %zu; worst view %.1f dB, largest difference "
           "%.2g; %.1f ms instead of %.1f", prune_eps, r.views, r.after[0],
           r.before[0], r.after[1], r.before[1], r.after[2], r.before[2],
           r.psnr, r.max_abs, r.ms_kept, r.ms_full);
}

/* --bake: the identity, then its Gaussians. */
static void branches_bake(struct stream_writer *out)
{
    static struct bake k;
    struct error err = {0};

    k.out = out;
    branches_open_model(&k);
    branches_copy_identity(&k);
    double begun = stats_begin();
    if (baker_bake(&k.baker, k.verts, &k.person, &err) ||
        baker_copy(&k.baked, &k.baker, false, &err) ||
        target_light_apply(&k.baked, &light, NULL, &err)) {
        error_prefix(&err, "%s", bake_path);
        cli_abandon_stream(out, &err);
    }
    stats_end("bake", begun);
    const struct mouth_branch *mouth = &k.baker.avatar.mouth;
    if (k.baker.config.system != SYSTEM_SPID)
        notice("%zu Gaussians, %zu of them on vertices", k.baked.N,
               k.baked.dynamic);
    else
        notice("%zu Gaussians; mouth: bowl %.2f mm, lip %.2f mm, cap %.2f mm, "
               "%zu clamped", k.baked.N, mouth->lips.bowl / k.head.scale * 1e3,
               mouth->lips.lip / k.head.scale * 1e3,
               mouth->cap / k.head.scale * 1e3, mouth->clamped);
    branches_prune_avatar(&k);
    const struct shape moved = {
        .beta = k.person.shape, .n = k.person.nshape,
        .offset = k.person.offset, .vertices = k.person.noffset};
    if ((moved.offset && shape_write(out, 0, 0, &moved, &err)) ||
        baked_write(out, 0, 0, &k.baked, NULL, NULL, &err))
        cli_abandon_stream(out, &err);
    baked_release(&k.baked);
    baker_release(&k.baker);
    person_release(&k.person);
    head_release(&k.head);
    free(k.verts);
}

/* ---- Phase B ----------------------------------------------------------- */

/* Where meshes become Gaussians. */
struct move {
    struct mover mover;
    struct stream_writer *out;
};

static int branches_move_record(const struct record *rec, void *move,
                                struct error *err)
{
    struct move *m = move;
    double begun = stats_begin();

    if (mover_apply(&m->mover, m->out, rec, err))
        return -1;
    if (record_is(rec, RECORD_MESH))
        stats_end("branches", begun);
    return 0;
}

/* -i: answer every mesh of the stream. */
static void branches_move_avatar(struct stream_writer *out, const char *input)
{
    static struct move m;
    const struct mover_options opt = {.full = full, .without = without,
                                      .light = light};
    struct error err = {0};

    m.out = out;
    if (mover_open(&m.mover, avatar_path, &opt, &err))
        die_error(&err);
    if (stream_load(input, branches_move_record, &m, &err))
        cli_abandon_stream(out, &err);
    mover_release(&m.mover);
}

/* What excludes each other. */
static void branches_check_options(int operands)
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
    if (bake_path && light.from == LIGHT_DRIVER)
        die(EX_USAGE, "--light=driver: nobody drives yet (expected with -i)");
    if (avatar_path && prune_eps >= 0)
        die(EX_USAGE, "--prune works at baking (expected with --bake)");
}

int main(int argc, char **argv)
{
    struct error err = {0};

    int first = cli_parse_stage(&usage, argc, argv, false);
    branches_check_options(argc - first);
    struct stream_writer *out = cli_create_stream(cli.output);

    if (bake_path)
        branches_bake(out);
    else
        branches_move_avatar(out, first < argc ? argv[first] : "-");
    if (stream_finish(out, &err))
        die_error(&err);
    stats_write();
    return 0;
}
