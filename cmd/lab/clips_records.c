/* Clips' records beside each other in a folder, made once. */
#include "cmd/lab/clips.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "cmd/options.h"
#include "formats/outfile.h"
#include "lib/net/model.h"

/* "FOLDER/clip-0123abcd.ENDING": its name, and a hash of its whole path. */
static void clips_record_path(char *out, size_t room, const char *folder,
                              const char *clip, const char *ending)
{
    const char *base = strrchr(clip, '/');
    const char *dot;

    base = base ? base + 1 : clip;
    dot = strrchr(base, '.');
    snprintf(out, room, "%s/%.*s-%08x.%s", folder,
             dot && dot != base ? (int)(dot - base) : (int)strlen(base), base,
             (unsigned)(XXH3_64bits(clip, strlen(clip)) & 0xffffffffu),
             ending);
}

/* Whether records or a reason are there already. */
static bool clips_is_done(const char *folder, const char *clip,
                          const char *ending)
{
    char path[2 * CLIPS_MAX];

    clips_record_path(path, sizeof path, folder, clip, ending);
    return access(path, F_OK) == 0;
}

/* Whether the list of clips has this very line. */
static bool clips_is_noted(const char *path, const char *line)
{
    char seen[2 * CLIPS_MAX];
    bool found = false;
    FILE *f = fopen(path, "r");

    while (f && !found && fgets(seen, sizeof seen, f))
        found = !strcmp(seen, line);
    if (f)
        fclose(f);
    return found;
}

/* A line of clips.tsv in one write, so that several programs may add to it.
 * It is written before the records or the reason get their names: a program
 * killed between the two finds its own line when it makes them again. */
static void clips_note(const char *folder, const char *clip,
                       const struct clip_report *r, const char *why)
{
    char path[CLIPS_MAX + 20], line[2 * CLIPS_MAX];
    int n = snprintf(line, sizeof line, "%s\t%zu\t%zu\t%zu\t%.1f\t%.2f\t%.3f"
                     "\t%s\n", clip, r->read, r->tried, r->kept, r->face,
                     r->outlined, r->score, why);

    snprintf(path, sizeof path, "%.*s/clips.tsv", CLIPS_MAX, folder);
    if (clips_is_noted(path, line))
        return;
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (fd < 0 || n <= 0 || n >= (int)sizeof line ||
        write(fd, line, (size_t)n) != n)
        die(EX_IOERR, "%s: cannot write: %s", path, strerror(errno));
    close(fd);
}

/* The reason beside where the records would be, so that it is not tried
 * again; it is there whole or, on a full disk, not at all. */
static void clips_note_bad(const char *folder, const char *clip,
                           const char *why)
{
    char path[2 * CLIPS_MAX];
    struct outfile out;
    struct error err = {0};

    clips_record_path(path, sizeof path, folder, clip, "bad");
    if (outfile_open(&out, path, &err))
        die_error(&err);
    fprintf(out.file, "%s\n", why);
    if (outfile_close(&out, &err))
        die_error(&err);
}

/* One clip; whether it was good. */
static bool clips_prepare_one(const struct clip *c, const char *folder,
                              const char *clip)
{
    char path[2 * CLIPS_MAX];
    struct clip_report r;
    struct error err = {0};

    clips_record_path(path, sizeof path, folder, clip, "spid");
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
        clips_note(folder, clip, &r, err.text);
        clips_note_bad(folder, clip, err.text);
        return false;
    }
    clips_note(folder, clip, &r, "");
    if (stream_finish(w, &err))
        die_error(&err);
    return true;
}

/* Every clip of the part: the lines that are spid-prepare. */
static size_t clips_prepare_each(const struct names *names,
                                 const struct clips_job *job,
                                 const struct clip *c, size_t *all)
{
    size_t made = 0, bad = 0, old_bad = 0, there = 0, mine = 0;

    for (size_t i = job->part; i < names->count; i += job->parts) {
        const char *clip = names->name[i];

        progress("clips", mine++, (names->count + job->parts - 1) /
                 job->parts, clip);
        if (clips_is_done(job->folder, clip, "spid"))
            there++;
        else if (clips_is_done(job->folder, clip, "bad"))
            old_bad++;
        else if (clips_prepare_one(c, job->folder, clip))
            made++;
        else
            bad++;
    }
    progress_end();
    notice("%zu clips: %zu made, %zu were there, %zu bad", mine, made,
           there + old_bad, bad);
    *all = mine;
    return made + there;
}

/* The folder of the records, and the one it lies in. */
static void clips_make_folder(const char *path)
{
    char outer[CLIPS_MAX];

    snprintf(outer, sizeof outer, "%s", path);
    char *slash = strrchr(outer, '/');
    if (mkdir(path, 0777) == 0 || errno == EEXIST)
        return;
    if (slash && slash > outer && errno == ENOENT) {
        *slash = 0;
        if ((mkdir(outer, 0777) == 0 || errno == EEXIST) &&
            (mkdir(path, 0777) == 0 || errno == EEXIST))
            return;
    }
    die(EX_CANTCREAT, "%s: %s", path, strerror(errno));
}

/* Clips of the part without records or a reason. */
static size_t clips_left(const struct names *c, const struct clips_job *job)
{
    size_t n = 0;

    for (size_t i = job->part; i < c->count; i += job->parts)
        n += !clips_is_done(job->folder, c->name[i], "spid") &&
             !clips_is_done(job->folder, c->name[i], "bad");
    return n;
}

size_t clips_prepare(const struct names *c, const struct clips_job *job,
                     size_t *all)
{
    struct error err = {0};
    struct model model;
    struct head head;
    struct encoders nets;

    clips_make_folder(job->folder);
    if (!clips_left(c, job))            /* no network is needed */
        return clips_prepare_each(c, job, NULL, all);
    if (option_model_open(&model, &err) ||
        option_head_load(&head, job->head_path, &err) ||
        encoders_open(&nets, &model, true, job->precision, &err))
        die_error(&err);
    struct clip clip = {.head = &head, .model = &model, .nets = &nets,
                        .opt = job->opt};
    clip.opt.track.size = (double)(job->size ? job->size : model.config.size);
    if (clip.opt.min_frames > clip.opt.frames)
        clip.opt.min_frames = clip.opt.frames;
    size_t good = clips_prepare_each(c, job, &clip, all);
    encoders_release(&nets);
    head_release(&head);
    model_close(&model);
    return good;
}
