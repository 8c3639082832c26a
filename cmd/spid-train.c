/* spid-train: from people and their true motions to a model. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "cmd/options.h"
#include "formats/image.h"
#include "lib/model/config.h"
#include "lib/head/head.h"
#include "lib/train/checkpoint.h"
#include "lib/train/loop.h"
#include "lib/train/predicted_shape.h"

#define MOST_PARTS 16

static struct {
    const char *config, *head, *validation, *join, *shapes;
    struct checkpoint_source init[MOST_PARTS];
    size_t ninit;
    long steps;
} opt = {.steps = -1};

static volatile sig_atomic_t stop;

static void on_signal(int number)
{
    (void)number;
    stop = 1;
}

/* FILE, FILE:PREFIX or FILE:PREFIX=FROM */
static int add_source(const char *value, bool grow, struct error *err)
{
    char *copy = strdup(value), *colon, *equals;

    if (opt.ninit == MOST_PARTS || !copy) {
        free(copy);
        return error_set(err, EX_USAGE, "more than %d files", MOST_PARTS);
    }
    colon = strrchr(copy, ':');
    if (colon)
        *colon++ = 0;
    equals = colon ? strchr(colon, '=') : NULL;
    if (equals)
        *equals++ = 0;
    opt.init[opt.ninit++] = (struct checkpoint_source){
        .path = copy, .prefix = colon ? colon : "",
        .from = equals ? equals : colon ? colon : "", .grow = grow};
    return 0;
}

static int parse_init(const char *value, void *dest, struct error *err)
{
    (void)dest;
    return add_source(value, false, err);
}

static int parse_grow(const char *value, void *dest, struct error *err)
{
    (void)dest;
    return add_source(value, true, err);
}

static const struct cli_option options[] = {
    {.name = "config", .letter = 'c', .kind = CLI_STRING, .dest = &opt.config,
     .arg = "FILE", .help = "JSON configuration of the run (required)"},
    {.name = "validation", .kind = CLI_STRING, .dest = &opt.validation,
     .arg = "FILE", .help = "people for validation, never trained on"},
    {.name = "held", .kind = CLI_STRING, .dest = &opt.validation,
     .arg = "FILE", .help = "the same as --validation"},
    OPTION_HEAD(&opt.head),
    {.name = "shapes", .kind = CLI_STRING, .dest = &opt.shapes, .arg = "FILE",
     .help = "people's shapes by FILE's E_beta, not the true ones"},
    {.name = "init", .kind = CLI_CALL, .parse = parse_init,
     .arg = "FILE[:PREFIX[=FROM]]",
     .help = "start tensors PREFIX... from FILE's FROM...; repeatable"},
    {.name = "grow", .kind = CLI_CALL, .parse = parse_grow,
     .arg = "FILE[:PREFIX[=FROM]]",
     .help = "the same from a narrower network"},
    {.name = "join", .kind = CLI_STRING, .dest = &opt.join, .arg = "FILE",
     .help = "no training: join model files into FILE, half precision"},
    {.name = "steps", .kind = CLI_INT, .dest = &opt.steps, .min = 0,
     .max = 1e9, .arg = "N", .help = "instead of the configuration's steps"},
    {.name = NULL},
};

static const struct cli_usage usage = {
    .program = "spid-train",
    .synopsis = "-c CONFIG -o DIR [OPTION ...] [STREAM ...]",
    .purpose = "train the encoders and the avatar through the renderer",
    .options = options,
};

/* Steps of this run, and its memory's most: what a longer run will need. */
static void print_cost(size_t steps, double seconds)
{
    struct rusage use;

    if (steps && !getrusage(RUSAGE_SELF, &use))
        fprintf(stderr, "spid-train: %zu steps, %.2f s a step, at most %.2f "
                "GB\n", steps, seconds / (double)steps,
                (double)use.ru_maxrss / 1e6);
}

static size_t steps_done;

/* The line of progress. */
static void print_step(const struct loop_report *r)
{
    char note[300];
    int at = snprintf(note, sizeof note, "loss %.4f", r->loss);
    long left = (long)r->left;

    for (int i = 0; i < r->task->nparts && at < 200; i++)
        at += snprintf(note + at, sizeof note - (size_t)at, " %.4s %.3f",
                       r->task->part_name[i], r->parts[i]);
    snprintf(note + at, sizeof note - (size_t)at,
             " %.1f items/s, %ld:%02ld:%02ld left", r->items_per_second,
             left / 3600, left / 60 % 60, left % 60);
    steps_done++;
    progress(train_stage_name(r->task->config->stage), (size_t)r->step + 1,
             (size_t)r->steps, note);
}

static void print_warning(const char *text)
{
    warn("%s", text);
}

static int write_png(const char *path, const uint8_t *rgb, size_t H, size_t W,
                     struct error *err)
{
    return image_write_png(path, rgb, W, H, 3, err);
}

static void load_head(struct head *h)
{
    struct error err = {0};

    if (option_head_load(h, opt.head, &err))
        die_error(&err);
}

/* People of --validation. */
static void load_validation(struct task *t, const struct train_config *c,
                            struct predicted_shape *shape)
{
    struct error err = {0};
    struct data_reader *r;

    if (!opt.validation)
        return;
    r = data_open(&opt.validation, 1, t->type->margin, &err);
    t->validation = calloc((size_t)c->validation_people, sizeof *t->validation);
    if (!r || !t->validation)
        die_error(&err);
    if (opt.shapes)
        data_reshape(r, predicted_shape_apply, shape);
    data_once(r);
    for (; t->nvalidation < (size_t)c->validation_people; t->nvalidation++) {
        int rc = data_next(r, &t->validation[t->nvalidation], &err);
        if (rc < 0)
            die_error(&err);
        if (rc)
            break;
    }
    data_close(r);
}

static void release_validation(struct task *t)
{
    for (size_t i = 0; i < t->nvalidation; i++)
        data_person_release(&t->validation[i]);
    free(t->validation);
    t->validation = NULL;
    t->nvalidation = 0;
}

/* The metadata of a model: its configuration, with the head it is for. */
static char *describe_model(const struct train_config *c)
{
    struct error err = {0};
    struct avatar_config model;
    struct head head;
    char *text;

    avatar_config_shipped(&model);
    if (c->model && avatar_config_parse(&model, c->model, &err))
        die_error(&err);
    load_head(&head);
    memcpy(model.head_hash, head.hash, sizeof model.head_hash);
    head_release(&head);
    text = avatar_config_print(&model);
    if (!text)
        die(EX_OSERR, "out of memory");
    return text;
}

static int join_models(const struct train_config *c, char **parts, int count)
{
    struct error err = {0};
    char *spid;

    if (count < 1)
        die(EX_USAGE, "--join: no model files (expected at least one)");
    spid = describe_model(c);
    if (checkpoint_join(opt.join, (const char *const *)parts, (size_t)count,
                        ST_F16, spid, &err))
        die_error(&err);
    free(spid);
    return EX_OK;
}

/* What is trained, and what stands in for what is not given. */
static void print_run(const struct task *t, const struct train_config *c)
{
    size_t learning = 0;

    if (cli.quiet)
        return;
    for (size_t i = 0; i < t->ps.count; i++)
        learning += t->ps.tensor[i].frozen ? 0 : t->ps.tensor[i].count;
    fprintf(stderr, "spid-train: stage %s, %zu weights learn, batch %lld\n",
            train_stage_name(c->stage), learning, (long long)c->batch);
    if (c->stage >= STAGE_AVATAR && !*c->perceptual_file)
        fprintf(stderr, "spid-train: no perceptual network is given: a "
                "Laplacian pyramid stands in for L_perc\n");
    if (c->stage == STAGE_MOTION || c->stage == STAGE_ALL)
        fprintf(stderr, "spid-train: no alignment network is given: "
                "projected landmarks stand in for L_lmk\n");
}

/* Returns the exit code. */
static int run_training(const struct train_config *c, const char *const *files,
                        size_t count, struct group *group)
{
    struct error err = {0};
    struct head head = {0};
    struct task task = {0};
    struct predicted_shape shape = {0};
    struct loop loop = {
        .config = c,
        .task = &task,
        .group = group,
        .folder = cli.output,
        .init = opt.init,
        .ninit = opt.ninit,
        .stop = &stop,
        .warn = print_warning,
        .report = cli.quiet ? NULL : print_step,
        .write_png = write_png,
    };
    int rc;

    load_head(&head);
    if (opt.shapes && predicted_shape_open(&shape, opt.shapes, &head, &err))
        die_error(&err);
    rc = task_init(&task, c, &head, &err);
    if (!rc) {
        load_validation(&task, c, &shape);
        if (!group->rank)
            print_run(&task, c);
        loop.reader = data_open(files, count, task.type->margin, &err);
        if (loop.reader && opt.shapes)
            data_reshape(loop.reader, predicted_shape_apply, &shape);
        double begun = stats_begin();
        rc = loop.reader ? loop_run(&loop, &err) : -1;
        progress_end();
        print_cost(steps_done, stats_begin() - begun);
    }
    if (rc) {
        fprintf(stderr, "spid-train: %s\n", err.text);
        group_abort(group, err.code);
    } else if (loop.step < (uint64_t)c->steps) {
        warn("stopped after step %llu; the same command goes on",
             (unsigned long long)loop.step);
    }
    data_close(loop.reader);
    predicted_shape_close(&shape);
    release_validation(&task);
    task_release(&task);
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
    if (opt.join) {
        rc = join_models(&config, argv + first, argc - first);
    } else {
        if (!strcmp(cli.output, "-"))
            die(EX_USAGE, "no folder for the model (expected -o DIR)");
        signal(SIGINT, on_signal);
        signal(SIGTERM, on_signal);
        rc = run_training(&config, (const char *const *)argv + first,
                          (size_t)(argc - first), &group);
    }
    train_config_release(&config);
    group_release(&group);
    return rc;
}
