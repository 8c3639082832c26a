/* Which clips operands name (their records: clips_records.c). */
#include "cmd/lab/clips.h"

#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lib/base/file.h"
#include "lib/stream/stream.h"

static bool clips_is_visible(const char *entry)
{
    return entry[0] != '.';
}

/* Whether the path is a folder. */
static bool clips_is_folder(const char *path)
{
    struct stat st;

    return stat(path, &st) == 0 && S_ISDIR(st.st_mode);
}

void clips_add(struct names *c, const char *operand)
{
    struct error err = {0};
    size_t i = c->count;
    int rc = *operand == '@' ? names_add_lines(c, operand + 1, &err)
             : clips_is_folder(operand)
                 ? names_add_folder(c, operand, clips_is_visible, &err)
                 : names_add(c, operand, &err);

    if (rc < 0)
        die_error(&err);
    if (*operand != '@' && c->count == i)
        die(EX_NOINPUT, "%s: an empty folder (expected clips)", operand);
    for (; i < c->count; i++)
        if (strlen(c->name[i]) > CLIPS_MAX)
            die(EX_USAGE, "a name of %zu characters (expected at most %d)",
                strlen(c->name[i]), CLIPS_MAX);
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
    struct names clips = {0};
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
    names_release(&clips);
    return n;
}
