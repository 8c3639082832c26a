/* spid-fit: labelled pictures of real people as training data. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/fit_records.h"
#include "lib/track/encoders.h"

#define MAX_SAME 64

static long size = 384, rounds = 5;
static const char *head_path, *assets_path, *base_path;
static const char *motions_path, *held_path;
static long acts = 20, every = 1;
static struct label_names except, hold;
static const char *same[MAX_SAME][2];
static size_t nsame;
static bool plain, matte;

/* PREFIX, one more of dest, a struct label_names. */
static int fit_parse_name(const char *value, void *dest, struct error *err)
{
    struct label_names *to = dest;

    if (to->n == LABEL_NAMES)
        return error_set(err, EX_USAGE, "more than %d", LABEL_NAMES);
    to->begin[to->n++] = value;
    return 0;
}

/* --same A,B */
static int fit_parse_same(const char *value, void *dest, struct error *err)
{
    char *text = strdup(value), *comma = text ? strchr(text, ',') : NULL;

    (void)dest;
    if (!text)
        return error_set(err, EX_OSERR, "out of memory");
    if (!comma || comma == text || !comma[1] || strchr(comma + 1, ',')) {
        free(text);
        return error_set(err, EX_USAGE, "'%s' is no pair (expected A,B)",
                         value);
    }
    if (nsame == MAX_SAME) {
        free(text);
        return error_set(err, EX_USAGE, "more than %d pairs", MAX_SAME);
    }
    *comma = 0;
    same[nsame][0] = text;
    same[nsame++][1] = comma + 1;
    return 0;
}

static const struct cli_option options[] = {
    OPTION_STRING("assets", 0, &assets_path, "DIR",
                  "where ict/ and labels/mediapipe_to_ict.json are"),
    OPTION_STRING("base", 0, &base_path, "DIR",
                  "what the labels' names are relative to (default: the "
                  "folder that DIR of --assets is in)"),
    OPTION_CALL("except", 0, &except, "PREFIX", fit_parse_name,
                "leave out the names that begin so; repeatable"),
    OPTION_CALL("hold", 0, &hold, "PREFIX", fit_parse_name,
                "people with such names go to the file of --held; "
                "repeatable"),
    OPTION_STRING("held", 0, &held_path, "FILE",
                  "where they go, for validation"),
    OPTION_INT("every", 0, &every, 1, 100000, "N",
               "write each N-th labelled frame of a clip (default 1)"),
    OPTION_CALL("same", 0, &nsame, "A,B", fit_parse_same,
                "these two files show one person"),
    OPTION_INT("size", 0, &size, 64, 2048, "PIXELS",
               "side of the pictures (default 384)"),
    OPTION_INT("rounds", 0, &rounds, 1, 100, "N",
               "rounds of the fit (default 5)"),
    OPTION_FLAG("plain", 0, &plain,
                "only pictures whose masks are certain, as before a plain wall"),
    OPTION_FLAG("matte", 0, &matte,
                "masks by MODEL's matte network, not the head's outline"),
    OPTION_STRING("motions", 0, &motions_path, "FILE",
                  "also avatars of the people, acting as this stream's do"),
    OPTION_INT("acts", 0, &acts, 1, 100000, "N",
               "pictures of each avatar (default 20)"),
    OPTION_HEAD(&head_path),
    {0}
};

static const struct cli_usage usage = {
    "spid-fit", "--assets DIR [OPTION ...] LABELS ...",
    "make training data of labelled pictures", options
};

/* The landmarks' points on the head. */
static void fit_open_points(struct face_points *p, const struct head *head)
{
    struct error err = {0};
    struct landmark_map map;
    struct scan scan;
    char path[4096];

    snprintf(path, sizeof path, "%s/labels/mediapipe_to_ict.json",
             assets_path);
    if (landmark_map_read(&map, path, &err))
        die_error(&err);
    snprintf(path, sizeof path, "%s/ict/ict.safetensors", assets_path);
    if (scan_load(&scan, path, &err) ||
        face_points_init(p, head, &scan, &map, &err))
        die_error(&err);
    scan_release(&scan);
}

/* All labels of the operands, sorted by person. */
static void fit_open_labels(struct labels *l, char **file, int count)
{
    struct error err = {0};

    for (int i = 0; i < count; i++)
        if (labels_read(l, file[i], &except, &err))
            die_error(&err);
    if (labels_sort(l, (const char *const (*)[2])same, nsame, &err))
        die_error(&err);
}

/* The fit, round by round. */
static void fit_run_rounds(struct face_fit *f)
{
    struct error err = {0};

    for (long i = 0; i < rounds; i++) {
        double begun = stats_begin();

        if (face_fit_round(f, &err))
            die_error(&err);
        stats_end("round", begun);
        progress("rounds", (size_t)i + 1, (size_t)rounds, NULL);
    }
    progress_end();
    notice("%zu people, %zu frame%s, off by %.2f of %g pixels in the mean",
           f->people, f->count, plural(f->count), face_fit_error(f), FIT_SIZE);
}

/* Avatars by the model. */
static void fit_open_reenact(struct reenact *reenact)
{
    struct error err = {0};
    char model[4096], head[4096];

    if (cli_find_model("model.safetensors", model, sizeof model, &err) ||
        (!head_path &&
         cli_find_model("head.safetensors", head, sizeof head, &err)) ||
        reenact_open(reenact, model, head_path ? head_path : head,
                     motions_path, (size_t)size, 1, &err))
        die_error(&err);
}

/* The model's networks, for its matte's. */
static void fit_open_matte(struct encoders *nets)
{
    struct error err = {0};
    struct model model;

    if (option_model_open(&model, &err) ||
        encoders_open(nets, &model, true, OPTION_PRECISION_DEFAULT, &err))
        die_error(&err);
    if (!nets->has_matte)
        die(EX_CONFIG, "%s: no matte network (expected tensors matte.*)",
            model_path(&model));
    model_close(&model);
}

/* Whether one of a person's names is held. */
static bool fit_is_held(const struct face_fit *f, size_t who)
{
    const struct fit_person *p = &f->person[who];

    for (size_t k = p->first; k < p->first + p->count; k++)
        if (label_is_named(f->frame[k].label->file, &hold))
            return true;
    return false;
}

/* Everybody's records to r[0], of who is held to r[1]. */
static int fit_write_people(struct fit_records r[2], const struct face_fit *f,
                            struct error *err)
{
    for (size_t k = 0; k < f->count; k++) {
        const bool held = fit_is_held(f, f->frame[k].label->person);
        double begun = stats_begin();

        if (fit_records_write(&r[held], k, err))
            return -1;
        stats_end("cut", begun);
        progress("frames", k + 1, f->count, NULL);
    }
    return 0;
}

/* The output, and that of --held. */
static void fit_write_streams(const struct head *head,
                              const struct face_fit *f)
{
    const char *path[2] = {cli.output, held_path};
    const int n = held_path ? 2 : 1;
    struct error err = {0};
    struct fit_records r[2];
    struct reenact reenact = {0};
    struct encoders nets = {0};
    int rc = 0;

    if (matte)
        fit_open_matte(&nets);
    if (motions_path)
        fit_open_reenact(&reenact);
    for (int i = 0; i < n; i++) {
        if (fit_records_open(&r[i], path[i], head, f, base_path, (size_t)size,
                             &err))
            die_error(&err);
        r[i].plain = plain;
        r[i].every = (size_t)every;
        r[i].portrait.net = matte ? &nets.matte : NULL;
    }
    r[0].reenact = motions_path ? &reenact : NULL;
    r[0].acts = (size_t)acts;
    const bool whole = !fit_write_people(r, f, &err);
    progress_end();
    for (int i = 0; i < n; i++)
        rc = fit_records_close(&r[i], whole, &err) ? -1 : rc;
    if (rc)
        die_error(&err);
    encoders_release(&nets);
    reenact_release(&reenact);
}

int main(int argc, char **argv)
{
    static char above[4096];
    struct head head;
    struct face_points points;
    struct labels labels = {0};
    struct face_fit fit;
    struct error err = {0};
    int operand = cli_parse(&usage, argc, argv);

    if (!assets_path)
        die(EX_USAGE, "--assets is missing (expected a folder with ict/)");
    if (operand == argc)
        die(EX_USAGE, "no labels (expected safetensors of landmarks)");
    if (!held_path != !hold.n)
        die(EX_USAGE, "--hold and --held go together (expected both)");
    if (!base_path) {
        snprintf(above, sizeof above, "%s/..", assets_path);
        base_path = above;
    }
    if (option_head_load(&head, head_path, &err))
        die_error(&err);
    fit_open_labels(&labels, argv + operand, argc - operand);
    fit_open_points(&points, &head);
    if (face_fit_init(&fit, &points, &labels, &err))
        die_error(&err);
    fit_run_rounds(&fit);
    fit_write_streams(&head, &fit);
    face_fit_release(&fit);
    face_points_release(&points);
    labels_release(&labels);
    head_release(&head);
    stats_write();
    return 0;
}
