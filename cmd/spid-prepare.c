/* spid-prepare: plain videos of people to records that spid-train reads, one
 * stream for each clip. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "cmd/options.h"
#include "lib/base/file.h"
#include "lib/track/clip.h"

#define LONGEST 3000            /* characters of a name */

static const char *head_path;
static long frames = 24, least = 8, part, parts = 1;
static double min_face = 64;
static enum nn_type precision = OPTION_PRECISION_DEFAULT;

/* "I/N", I from 1 to N. */
static int parse_part(const char *value, void *dest, struct error *err)
{
    char *end;
    long i = strtol(value, &end, 10), n = *end == '/' ? strtol(end + 1, &end,
                                                               10) : 0;

    (void)dest;
    if (*end || i < 1 || i > n || n > 1000000)
        return error_set(err, EX_USAGE, "not a part (expected I/N, I from 1 "
                         "to N)");
    part = i - 1;
    parts = n;
    return 0;
}

static const struct cli_option options[] = {
    OPTION_INT("frames", 0, &frames, 1, 1000, "N",
               "frames kept of a clip, spread over it (default 24)"),
    OPTION_INT("least", 0, &least, 1, 1000, "N",
               "a clip with fewer good frames is bad (default 8)"),
    OPTION_FLOAT("min-face", 0, &min_face, 0, 10000, "PIXELS",
                 "smaller faces are not good (default 64)"),
    OPTION_CALL("part", 0, &part, "I/N", parse_part,
                "every N-th clip, from the I-th on"),
    OPTION_HEAD(&head_path),
    OPTION_PRECISION(&precision, "networks"),
    {0}
};

static const struct cli_usage usage = {
    "spid-prepare", "-o DIR [--frames N] [--least N] [--min-face PIXELS] "
    "[--part I/N] [--head FILE] [--precision TYPE] [-j N] [-m MODEL] [-q] "
    "[--stats FILE] CLIP|FOLDER|@LIST ...",
    "videos of people as training records", options
};

struct names {
    char **name;
    size_t count;
};

/* Append a clip. */
static void add_name(struct names *n, const char *name)
{
    char **grown = realloc(n->name, (n->count + 1) * sizeof *grown);

    if (!grown || !(grown[n->count] = strdup(name)))
        die(EX_OSERR, "no memory for %zu names", n->count + 1);
    n->name = grown;
    n->count++;
}

static int visible(const struct dirent *d)
{
    return d->d_name[0] != '.';
}

/* All that is in a folder, each a clip; a folder of pictures is one, too. */
static void add_folder(struct names *n, const char *path)
{
    struct dirent **entry;
    char name[LONGEST + 300];
    int count = scandir(path, &entry, visible, versionsort);

    if (count < 0)
        die(EX_NOINPUT, "%s: %s", path, strerror(errno));
    if (count == 0)
        die(EX_NOINPUT, "%s: an empty folder (expected clips)", path);
    for (int i = 0; i < count; i++) {
        snprintf(name, sizeof name, "%.*s/%s", LONGEST, path,
                 entry[i]->d_name);
        add_name(n, name);
        free(entry[i]);
    }
    free(entry);
}

/* One name on each line. */
static void add_list(struct names *n, const char *path)
{
    struct error err = {0};
    char *text = file_read_text(path, 256 << 20, &err), *rest = text, *line;

    if (!text)
        die_error(&err);
    while ((line = strsep(&rest, "\n")))
        if (*line && *line != '#')
            add_name(n, line);
    free(text);
}

static void find_clips(struct names *n, char **operand)
{
    struct stat st;

    for (; *operand; operand++) {
        if (**operand == '@')
            add_list(n, *operand + 1);
        else if (stat(*operand, &st) == 0 && S_ISDIR(st.st_mode))
            add_folder(n, *operand);
        else
            add_name(n, *operand);
    }
}

/* "DIR/clip-0123abcd.ENDING": its name, and a hash of its whole path. */
static void name_output(char *out, size_t room, const char *clip,
                        const char *ending)
{
    const char *base = strrchr(clip, '/');
    const char *dot;

    base = base ? base + 1 : clip;
    dot = strrchr(base, '.');
    snprintf(out, room, "%s/%.*s-%08x.%s", cli.output,
             dot && dot != base ? (int)(dot - base) : (int)strlen(base), base,
             (unsigned)(XXH3_64bits(clip, strlen(clip)) & 0xffffffffu),
             ending);
}

/* A line of clips.tsv in one write, so that several programs may add to it. */
static void note_clip(const char *clip, const struct clip_report *r,
                      const char *why)
{
    char path[LONGEST + 20], line[2 * LONGEST];
    int n = snprintf(line, sizeof line, "%s\t%zu\t%zu\t%zu\t%.1f\t%.2f\t%.3f"
                     "\t%s\n", clip, r->read, r->tried, r->kept, r->face,
                     r->outlined, r->score, why);

    snprintf(path, sizeof path, "%s/clips.tsv", cli.output);
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (fd < 0 || n <= 0 || n >= (int)sizeof line ||
        write(fd, line, (size_t)n) != n)
        die(EX_IOERR, "%s: cannot write: %s", path, strerror(errno));
    close(fd);
}

/* The reason beside where the records would be, so that it is not tried
 * again. */
static void note_bad(const char *clip, const char *why)
{
    char path[LONGEST + 300];

    name_output(path, sizeof path, clip, "bad");
    FILE *f = fopen(path, "w");
    if (!f || fprintf(f, "%s\n", why) < 0 || fclose(f))
        die(EX_IOERR, "%s: cannot write: %s", path, strerror(errno));
}

/* 0: made; 1: bad. */
static int prepare(const struct clip *c, const char *clip)
{
    char path[LONGEST + 300];
    struct clip_report r;
    struct error err = {0};

    name_output(path, sizeof path, clip, "spid");
    struct stream_writer *w = stream_create(path, &err);
    if (!w)
        die_error(&err);
    double begun = stats_begin();
    int rc = clip_prepare(w, &r, c, clip, &err);
    stats_end("clip", begun);
    if (rc) {
        stream_abandon(w);
        if (rc < 0)
            die_error(&err);
        warn("%s", err.text);
        note_bad(clip, err.text);
        note_clip(clip, &r, err.text);
        return 1;
    }
    if (stream_finish(w, &err))
        die_error(&err);
    note_clip(clip, &r, "");
    return 0;
}

/* Whether records or a reason are there already. */
static bool is_done(const char *clip, const char *ending)
{
    char path[LONGEST + 300];

    name_output(path, sizeof path, clip, ending);
    return access(path, F_OK) == 0;
}

/* Every clip of this part: the lines that are this program. */
static int prepare_all(const struct clip *c, const struct names *n)
{
    size_t made = 0, bad = 0, there = 0, mine = 0;

    for (size_t i = (size_t)part; i < n->count; i += (size_t)parts) {
        const char *clip = n->name[i];

        if (strlen(clip) > LONGEST)
            die(EX_USAGE, "a name of %zu characters (expected at most %d)",
                strlen(clip), LONGEST);
        progress("clips", mine++, (n->count + (size_t)parts - 1) /
                 (size_t)parts, clip);
        if (is_done(clip, "spid") || is_done(clip, "bad"))
            there++;
        else if (prepare(c, clip))
            bad++;
        else
            made++;
    }
    progress_end();
    if (!cli.quiet)
        fprintf(stderr, "spid-prepare: %zu clips: %zu made, %zu were there, "
                "%zu bad\n", made + there + bad, made, there, bad);
    return made + there ? EX_OK : EX_DATAERR;
}

int main(int argc, char **argv)
{
    struct error err = {0};
    struct model model;
    struct head head;
    struct encoders nets;
    struct names names = {0};
    int first = cli_parse(&usage, argc, argv);

    if (first == argc)
        die(EX_USAGE, "no clips (expected videos, folders of them or @LIST)");
    if (!strcmp(cli.output, "-"))
        die(EX_USAGE, "no folder for the records (expected -o DIR)");
    if (mkdir(cli.output, 0777) && errno != EEXIST)
        die(EX_CANTCREAT, "%s: %s", cli.output, strerror(errno));
    find_clips(&names, argv + first);
    if (option_model_open(&model, &err) ||
        option_head_load(&head, head_path, &err) ||
        encoders_open(&nets, &model, true, precision, &err))
        die_error(&err);
    const struct clip c = {
        .head = &head, .model = &model, .nets = &nets,
        .opt = {.frames = (size_t)frames, .min_face = min_face,
                .least = (size_t)(least < frames ? least : frames),
                .track = {.size = (double)model.config.size}}};
    int rc = prepare_all(&c, &names);
    stats_write();
    for (size_t i = 0; i < names.count; i++)
        free(names.name[i]);
    free(names.name);
    encoders_release(&nets);
    head_release(&head);
    model_close(&model);
    return rc;
}
