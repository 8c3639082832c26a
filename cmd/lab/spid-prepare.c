/* spid-prepare: plain videos of people to records that spid-train reads, one
 * stream for each clip. */
#include <stdlib.h>
#include <string.h>

#include "cmd/lab/clips.h"
#include "cmd/options.h"

static const char *head_path;
static long frames = CLIPS_FRAMES, min_frames = CLIPS_MIN_FRAMES, size;
static long part, parts = 1;
static double min_face = CLIPS_MIN_FACE;
static enum nn_type precision = OPTION_PRECISION_DEFAULT;

/* "I/N", I from 1 to N. */
static int prepare_parse_part(const char *value, void *dest, struct error *err)
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
    OPTION_CLIP_FRAMES(&frames),
    OPTION_INT("least", 0, &min_frames, 1, 1000, "N",
               "a clip with fewer good frames is bad (default 8)"),
    OPTION_FLOAT("min-face", 0, &min_face, 0, 10000, "PIXELS",
                 "smaller faces are not good (default 64)"),
    OPTION_INT("size", 0, &size, 64, 2048, "PIXELS",
               "side of the pictures (default the model's)"),
    OPTION_CALL("part", 0, &part, "I/N", prepare_parse_part,
                "every N-th clip, from the I-th on"),
    OPTION_HEAD(&head_path),
    OPTION_PRECISION(&precision, "networks"),
    {0}
};

static const struct cli_usage usage = {
    "spid-prepare", "-o DIR [OPTION ...] CLIP|FOLDER|@LIST ...",
    "videos of people as training records", options
};

int main(int argc, char **argv)
{
    struct names clips = {0};
    size_t all;
    int first = cli_parse(&usage, argc, argv);

    if (first == argc)
        die(EX_USAGE, "no clips (expected videos, folders of them or @LIST)");
    if (!strcmp(cli.output, "-"))
        die(EX_USAGE, "no folder for the records (expected -o DIR)");
    for (int i = first; i < argc; i++)
        clips_add(&clips, argv[i]);
    const struct clips_job job = {
        .folder = cli.output, .head_path = head_path, .precision = precision,
        .part = (size_t)part, .parts = (size_t)parts, .size = (size_t)size,
        .opt = {.frames = (size_t)frames, .min_frames = (size_t)min_frames,
                .min_face = min_face}};
    size_t good = clips_prepare(&clips, &job, &all);
    stats_write();
    names_release(&clips);
    return good || !all ? EX_OK : EX_DATAERR;
}
