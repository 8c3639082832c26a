/* spid-train: from people and their true motions to a model. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/lab/clips.h"
#include "cmd/options.h"
#include "cmd/lab/train_report.h"
#include "formats/image.h"
#include "lib/net/config.h"
#include "lib/head/head.h"
#include "lib/lab/data/scenery.h"
#include "lib/lab/train/checkpoint.h"
#include "lib/lab/train/loop.h"
#include "lib/lab/train/predicted_shape.h"

#define MAX_PARTS 16

static struct {
    const char *config, *head, *validation, *join, *shapes, *records;
    struct names scenery;
    struct checkpoint_source init[MAX_PARTS];
    size_t ninit;
    long steps, frames;
} opt = {.steps = -1, .frames = CLIPS_FRAMES};

static volatile sig_atomic_t stop;

static void train_on_signal(int number)
{
    (void)number;
    stop = 1;
}

static int train_parse_init(const char *value, void *dest, struct error *err)
{
    (void)dest;
    if (opt.ninit == MAX_PARTS)
        return error_set(err, EX_USAGE, "more than %d files", MAX_PARTS);
    return checkpoint_source_parse(&opt.init[opt.ninit++], value, err);
}

static int train_parse_scenery(const char *value, void *dest,
                               struct error *err)
{
    return names_add(dest, value, err);
}

static const struct cli_option options[] = {
    OPTION_STRING("config", 'c', &opt.config, "FILE",
                  "JSON configuration of the run (required)"),
    OPTION_STRING("records", 0, &opt.records, "DIR",
                  "records of plain clips (default records in the run's "
                  "folder)"),
    OPTION_CLIP_FRAMES(&opt.frames),
    OPTION_STRING("validation", 0, &opt.validation, "FILE",
                  "people for validation, never trained on"),
    OPTION_HEAD(&opt.head),
    OPTION_STRING("shapes", 0, &opt.shapes, "FILE",
                  "people's shapes by FILE's E_beta, not the true ones"),
    OPTION_CALL("init", 0, NULL, "FILE[:PREFIX[=FROM]]", train_parse_init,
                "start tensors PREFIX... from FILE's FROM...; repeatable"),
    OPTION_CALL("scenery", 0, &opt.scenery, "FILE", train_parse_scenery,
                "stage sure: a panorama that shows no face; repeatable"),
    OPTION_STRING("join", 0, &opt.join, "FILE",
                  "no training: join model files into FILE, half precision"),
    OPTION_INT("steps", 0, &opt.steps, 0, 1e9, "N",
               "instead of the configuration's steps"),
    {0}
};

static const struct cli_usage usage = {
    "spid-train",
    "-c CONFIG -o DIR [OPTION ...] [STREAM|CLIP|FOLDER|@LIST ...]",
    "train the encoders and the avatar through the renderer", options
};

static void train_load_head(struct head *h)
{
    struct error err = {0};

    if (option_head_load(h, opt.head, &err))
        die_error(&err);
}

/* People of --validation. */
static void train_load_validation(struct task *t, struct predicted_shape *shape)
{
    struct error err = {0};
    struct data_reader *r;

    if (!opt.validation)
        return;
    r = data_open(&opt.validation, 1, t->type->margin, &err);
    if (r && opt.shapes)
        data_reshape(r, predicted_shape_apply, shape);
    if (!r || task_read_validation(t, r, &err))
        die_error(&err);
    data_close(r);
}

/* The model that is trained. */
static struct avatar_config train_read_model(const struct train_config *c)
{
    struct error err = {0};
    struct avatar_config model;

    avatar_config_shipped(&model);
    if (c->model && avatar_config_parse(&model, c->model, &err))
        die_error(&err);
    return model;
}

/* The metadata of a model: its configuration, with the head it is for. */
static char *train_describe_model(const struct train_config *c)
{
    struct avatar_config model = train_read_model(c);
    struct head head;
    char *text;

    train_load_head(&head);
    memcpy(model.head_hash, head.hash, sizeof model.head_hash);
    head_release(&head);
    text = avatar_config_print(&model);
    if (!text)
        die(EX_OSERR, "out of memory");
    return text;
}

/* --join: the named model files as one, with the configuration's
 * description. */
static int train_join_models(const struct train_config *c, char **parts,
                             int count)
{
    struct error err = {0};
    char *spid;

    if (count < 1)
        die(EX_USAGE, "--join: no model files (expected at least one)");
    spid = train_describe_model(c);
    if (checkpoint_join(opt.join, (const char *const *)parts, (size_t)count,
                        spid, &err))
        die_error(&err);
    free(spid);
    return EX_OK;
}

/* The streams to read.  Records of plain clips are made first; the processes
 * of the group share them out. */
static size_t train_gather_data(const char **data, char **operand,
                                const struct train_config *c,
                                const struct group *group)
{
    static char folder[4096];
    struct error err = {0};
    bool none = false;
    const struct clips_job job = {
        .folder = opt.records ? opt.records : folder, .head_path = opt.head,
        .precision = OPTION_PRECISION_DEFAULT, .size = train_read_model(c).size,
        .part = (size_t)group->rank, .parts = (size_t)group->size,
        .opt = {.frames = (size_t)opt.frames, .min_frames = CLIPS_MIN_FRAMES,
                .min_face = CLIPS_MIN_FACE}};

    snprintf(folder, sizeof folder, "%s/records", cli.output);
    size_t n = clips_gather(data, operand, &job);
    if (group_any(group, &none, &err))          /* wait for the others */
        die_error(&err);
    return n;
}

/* Train l's task on the data, the main process reporting. */
static int train_loop(struct loop *l, struct predicted_shape *shape,
                      const char *const *files, size_t count,
                      struct error *err)
{
    const bool main_process = !l->group->rank;

    train_load_validation(l->task, shape);
    if (main_process)
        train_report_run(l->task);
    l->reader = data_open(files, count, l->task->type->margin, err);
    if (l->reader && opt.shapes)
        data_reshape(l->reader, predicted_shape_apply, shape);
    int rc = l->reader ? loop_run(l, err) : -1;

    progress_end();
    if (main_process)
        train_report_cost(&l->cost);
    return rc;
}

/* Returns the exit code. */
static int train_run(const struct train_config *c,
                     const char *const *files, size_t count,
                     struct group *group)
{
    struct error err = {0};
    struct head head = {0};
    struct task task = {0};
    struct predicted_shape shape = {0};
    struct scenery scenery = {0};
    struct loop loop = {
        .config = c,
        .task = &task,
        .group = group,
        .folder = cli.output,
        .init = opt.init,
        .ninit = opt.ninit,
        .stop = &stop,
        .warn = train_report_warning,
        .report = cli.quiet ? NULL : train_report_step,
    };
    int rc;

    train_load_head(&head);
    if (opt.shapes && predicted_shape_open(&shape, opt.shapes, &head, &err))
        die_error(&err);
    rc = task_init(&task, c, &head, &err);
    if (!rc && opt.scenery.count) {
        rc = scenery_read(&scenery, &opt.scenery, &err);
        task.scenery = &scenery;
    }
    if (!rc)
        rc = train_loop(&loop, &shape, files, count, &err);
    if (rc) {
        fprintf(stderr, "spid-train: %s\n", err.text);
        group_abort(group, err.code);
    } else if (loop.step < (uint64_t)c->steps) {
        warn("stopped after step %llu; the same command goes on",
             (unsigned long long)loop.step);
    }
    data_close(loop.reader);
    predicted_shape_close(&shape);
    task_release(&task);
    scenery_release(&scenery);
    head_release(&head);
    return rc ? (err.code ? err.code : EX_SOFTWARE) : EX_OK;
}

int main(int argc, char **argv)
{
    struct error err = {0};
    struct train_config config;
    struct group group;
    int first, rc;

    if (group_init(&group, &err))
        die_error(&err);
    first = cli_parse(&usage, argc, argv);
    if (!opt.config)
        die(EX_USAGE, "no configuration (expected -c FILE)");
    if (train_config_load(&config, opt.config, &err))
        die_error(&err);
    if (opt.steps >= 0)
        config.steps = opt.steps;
    if (opt.scenery.count && config.stage != STAGE_CONFIDENCE &&
        config.stage != STAGE_MATTE)
        die(EX_USAGE, "--scenery: stage %s learns from faces alone (expected "
            "stage sure or matte)", train_stage_name(config.stage));
    if (opt.join) {
        rc = train_join_models(&config, argv + first, argc - first);
    } else {
        if (!strcmp(cli.output, "-"))
            die(EX_USAGE, "no folder for the model (expected -o DIR)");
        signal(SIGINT, train_on_signal);
        signal(SIGTERM, train_on_signal);
        const char **data = calloc((size_t)(argc - first) + 1, sizeof *data);
        if (!data)
            die(EX_OSERR, "out of memory");
        size_t n = train_gather_data(data, argv + first, &config, &group);
        rc = train_run(&config, data, n, &group);
        free(data);
    }
    train_config_release(&config);
    group_release(&group);
    return rc;
}
