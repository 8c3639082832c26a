/* Which clips operands name (their records: clips_records.c). */
#include "cmd/lab/clips.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lib/base/file.h"
#include "lib/stream/stream.h"

/* Append a clip. */
static void clips_append(struct clips *c, const char *name)
{
    char **grown = realloc(c->name, (c->count + 1) * sizeof *grown);

    if (strlen(name) > CLIPS_LONGEST)
        die(EX_USAGE, "a name of %zu characters (expected at most %d)",
            strlen(name), CLIPS_LONGEST);
    if (!grown || !(grown[c->count] = strdup(name)))
        die(EX_OSERR, "no memory for %zu names", c->count + 1);
    c->name = grown;
    c->count++;
}

static int clips_visible(const struct dirent *d)
{
    return d->d_name[0] != '.';
}

/* All that is in a folder. */
static void clips_add_folder(struct clips *c, const char *path)
{
    struct dirent **entry;
    char name[CLIPS_LONGEST + 300];
    int count = scandir(path, &entry, clips_visible, versionsort);

    if (count < 0)
        die(EX_NOINPUT, "%s: %s", path, strerror(errno));
    if (count == 0)
        die(EX_NOINPUT, "%s: an empty folder (expected clips)", path);
    for (int i = 0; i < count; i++) {
        snprintf(name, sizeof name, "%.*s/%s", CLIPS_LONGEST, path,
                 entry[i]->d_name);
        clips_append(c, name);
        free(entry[i]);
    }
    free(entry);
}

/* One name on each line. */
static void clips_add_list(struct clips *c, const char *path)
{
    struct error err = {0};
    char *text = file_read_text(path, 256 << 20, &err), *rest = text, *line;

    if (!text)
        die_error(&err);
    while ((line = strsep(&rest, "\n")))
        if (*line && *line != '#')
            clips_append(c, line);
    free(text);
}

/* Whether the path is a folder. */
static bool clips_is_folder(const char *path)
{
    struct stat st;

    return stat(path, &st) == 0 && S_ISDIR(st.st_mode);
}

void clips_add(struct clips *c, const char *operand)
{
    if (*operand == '@')
        clips_add_list(c, operand + 1);
    else if (clips_is_folder(operand))
        clips_add_folder(c, operand);
    else
        clips_append(c, operand);
}

void clips_release(struct clips *c)
{
    for (size_t i = 0; i < c->count; i++)
        free(c->name[i]);
    free(c->name);
    *c = (struct clips){0};
}

/* What spid-prepare leaves in a folder. */
static int clips_is_record(const struct dirent *d)
{
    return file_ends(d->d_name, ".spid") || !strcmp(d->d_name, "clips.tsv");
}

/* Whether a regular file is a stream by its name or its first bytes; also when
 * it cannot be opened, as the reader then says what is wrong. */
static bool clips_is_stream(const char *path)
{
    return file_ends(path, ".spid") || access(path, R_OK) ||
           stream_probe(path);
}

/* Whether the operand names plain clips: "@FILE", a folder that holds no
 * records, a file that is no stream.  "-", devices and what is not there do
 * not. */
static bool clips_named(const char *operand)
{
    struct dirent **entry;

    if (*operand == '@')
        return true;
    if (clips_is_folder(operand)) {
        int n = scandir(operand, &entry, clips_is_record, NULL);

        for (int i = 0; i < n; i++)
            free(entry[i]);
        if (n >= 0)
            free(entry);
        return n == 0;
    }
    return access(operand, F_OK) == 0 && !file_is_special(operand) &&
           !clips_is_stream(operand);
}

size_t clips_gather(const char **data, char **operand,
                    const struct clips_job *job)
{
    struct clips clips = {0};
    size_t n = 0, all;

    for (; *operand; operand++) {
        if (clips_named(*operand))
            clips_add(&clips, *operand);
        else
            data[n++] = *operand;
    }
    if (clips.count) {
        clips_prepare(&clips, job, &all);
        data[n++] = job->folder;
    }
    clips_release(&clips);
    return n;
}
