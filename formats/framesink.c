/* Frames out: one sink for streams, videos, Y4M, PNG, PAM and EXR, chosen by
 * --format or the name, and the order of what is done to a frame. */
#include "formats/framesink.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/framesink_impl.h"
#include "formats/pattern.h"
#include "formats/terminal.h"
#include "lib/base/file.h"
#include "lib/stream/records.h"

/* ---- choosing --------------------------------------------------------- */

/* What --format calls it, and names end in. */
static const struct {
    const char *name;
    enum framesink_format format;
    bool option, ending;
} names[] = {
    {"stream", FRAMESINK_STREAM, true, false},
    {"spid", FRAMESINK_STREAM, false, true},
    {"mp4", FRAMESINK_VIDEO, true, true}, {"mkv", FRAMESINK_VIDEO, false, true},
    {"avi", FRAMESINK_VIDEO, false, true}, {"mov", FRAMESINK_VIDEO, false, true},
    {"webm", FRAMESINK_VIDEO, false, true},
    {"m4v", FRAMESINK_VIDEO, false, true}, {"gif", FRAMESINK_GIF, true, true},
    {"webp", FRAMESINK_WEBP, true, true}, {"apng", FRAMESINK_APNG, true, true},
    {"y4m", FRAMESINK_Y4M, true, true}, {"png", FRAMESINK_PNG, true, true},
    {"pam", FRAMESINK_PAM, true, true}, {"ppm", FRAMESINK_PAM, false, true},
    {"exr", FRAMESINK_EXR, true, true}
};

int framesink_parse_format(const char *value, void *format,
                           struct error *err)
{
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (names[i].option && strcmp(value, names[i].name) == 0) {
            *(enum framesink_format *)format = names[i].format;
            return 0;
        }
    return error_set(err, EX_USAGE, "unknown format (expected "
                     FRAMESINK_FORMATS ")");
}

/* By the ending; a stream, where the name has none or .spid. */
static int framesink_format_of(enum framesink_format *format, const char *path,
                               struct error *err)
{
    const char *slash = strrchr(path, '/');
    const char *base = slash ? slash + 1 : path, *dot = strrchr(base, '.');

    *format = !strncmp(path, "/dev/video", 10) ? FRAMESINK_DEVICE
              : httpsink_is_address(path)      ? FRAMESINK_HTTP
                                               : FRAMESINK_STREAM;
    if (*format != FRAMESINK_STREAM || !dot || dot == base ||
        file_is_special(path))
        return 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (names[i].ending && strcasecmp(dot + 1, names[i].name) == 0) {
            *format = names[i].format;
            return 0;
        }
    return error_set(err, EX_USAGE, "%s: such a file cannot be written "
                     "(expected .mp4 .mkv .mov .webm .avi, .gif .webp .apng, "
                     ".png .pam .ppm .exr, .y4m, or .spid or --format stream "
                     "for a stream of records)", path);
}

/* What can be refused before the first frame. */
static int framesink_check_options(const struct framesink_options *o,
                                   struct error *err)
{
    const bool pipe = strcmp(o->path, "-") == 0;
    const int pattern = pattern_count(o->path);

    if (pattern < 0 || pattern > 1)
        return error_set(err, EX_USAGE, "%s: bad pattern (expected one %%d "
                         "such as %%05d; %%%% for a percent sign)", o->path);
    if (pattern == 1 && o->format != FRAMESINK_PNG
        && o->format != FRAMESINK_EXR && o->format != FRAMESINK_PAM)
        return error_set(err, EX_USAGE, "%s: a pattern makes pictures, not a"
                         " stream or video (expected --format png, pam or "
                         "exr)", o->path);
    if (pipe && (o->format == FRAMESINK_EXR || framesink_is_video(o)))
        return error_set(err, EX_USAGE, "<stdout>: %s cannot be written to a"
                         " pipe (use -o FILE, or --format y4m)",
                         o->format == FRAMESINK_EXR ? "EXR" : "a video file");
    if (o->alpha && (o->format == FRAMESINK_Y4M ||
                     o->format == FRAMESINK_HTTP))
        return error_set(err, EX_USAGE, "%s: no alpha in %s (expected "
                         "--format png, pam or exr)", o->path,
                         o->format == FRAMESINK_Y4M ? "Y4M" : "a live video");
    if (o->alpha && o->format == FRAMESINK_VIDEO && !video_has_alpha(o->path))
        return error_set(err, EX_USAGE, "%s: no alpha in such a video "
                         "(expected .webm, .mkv or .mov, .webp, .apng or .gif, or "
                         "--format png, pam or exr)", o->path);
    return 0;
}

struct framesink *framesink_open(const struct framesink_options *opt,
                                 struct error *err)
{
    struct framesink *s = calloc(1, sizeof *s);

    if (s) {
        s->opt = *opt;
        s->path = strdup(opt->path);
    }
    if (!s || !s->path) {
        free(s);
        return error_null(err, EX_OSERR, "out of memory");
    }
    s->opt.path = s->path;
    if (s->opt.format == FRAMESINK_AUTO &&
        framesink_format_of(&s->opt.format, s->path, err) != 0)
        goto failed;
    if (framesink_check_options(&s->opt, err) != 0)
        goto failed;
    if (s->opt.format == FRAMESINK_STREAM) {
        s->stream = stream_create(s->path, err);
        if (!s->stream)
            goto failed;
    } else if (s->opt.format == FRAMESINK_HTTP) {
        s->http = httpsink_open(s->path, s->opt.anyone, err);
        if (!s->http)
            goto failed;
    } else if (strcmp(s->path, "-") == 0
               && s->opt.format != FRAMESINK_TERMINAL
               && outfile_open(&s->out, "-", err) != 0) {
        goto failed;
    }
    return s;
failed:
    framesink_abandon(s);
    return NULL;
}

struct stream_writer *framesink_stream(struct framesink *s)
{
    return s->stream;
}

void framesink_set_rate(struct framesink *s, int num, int den)
{
    if (s->count == 0 && s->opt.rate_num <= 0 && num > 0 && den > 0) {
        s->opt.rate_num = num;
        s->opt.rate_den = den;
    }
}

bool framesink_takes_sound(const struct framesink *s)
{
    return s->opt.format == FRAMESINK_VIDEO && video_has_sound(s->path);
}

bool framesink_set_sound(struct framesink *s, const char *clip, double start)
{
    if (!framesink_takes_sound(s))
        return false;
    free(s->sound);
    s->sound = clip ? strdup(clip) : NULL;
    s->start = start;
    return s->sound;
}

void framesink_set_end(struct framesink *s, double end)
{
    s->end = end;
}

void framesink_read_conf(struct framesink *s, const struct record *conf)
{
    size_t bytes;
    const char *text = conf_text(&bytes, conf);
    cJSON *json = text ? cJSON_ParseWithLength(text, bytes) : NULL;
    const cJSON *fps = cJSON_GetObjectItem(json, "fps");
    const cJSON *den = cJSON_GetArrayItem(fps, 1);
    const cJSON *sound = cJSON_GetObjectItem(json, "sound");
    const cJSON *clip = cJSON_GetObjectItem(sound, "clip");
    const cJSON *start = cJSON_GetObjectItem(sound, "start");

    if (cJSON_IsNumber(fps))
        framesink_set_rate(s, (int)(fps->valuedouble * 1000 + 0.5), 1000);
    else if (cJSON_IsArray(fps) && den)
        framesink_set_rate(s, cJSON_GetArrayItem(fps, 0)->valueint,
                           den->valueint);
    if (cJSON_IsString(clip) && cJSON_IsNumber(start))
        framesink_set_sound(s, clip->valuestring, start->valuedouble);
    cJSON_Delete(json);
}

const char *framesink_lost_sound(const struct framesink *s)
{
    struct stat st;

    return s->sound && (stat(s->sound, &st) || !S_ISREG(st.st_mode)) ? s->sound
                                                                   : NULL;
}

/* ---- writing one frame ------------------------------------------------ */

/* The frame in the format that was chosen. */
static int framesink_write_any(struct framesink *s,
                               const struct framesink_frame *f,
                               struct error *err)
{
    if (s->opt.format == FRAMESINK_STREAM)
        return s->opt.record == FRAMESINK_IMAG
                   ? framesink_write_imag(s, f, err)
                   : framesink_write_feat(s, f, err);
    if (framesink_is_video(&s->opt))
        return framesink_write_video(s, f->time, err);
    if (s->opt.format == FRAMESINK_TERMINAL)
        return framesink_write_terminal(s, err);
    if (s->opt.format == FRAMESINK_DEVICE)
        return framesink_write_device(s, err);
    if (s->opt.format == FRAMESINK_HTTP)
        return httpsink_write(s->http, s->pixel, s->width, s->height, err);
    if (s->opt.format == FRAMESINK_EXR)
        return framesink_write_exr(s, f, err);
    return framesink_write_picture(s, f, err);
}

/* Only one frame fits in a plain .png or .exr, and only one size in a video. */
static int framesink_check_frame(const struct framesink *s,
                                 const struct framesink_frame *f,
                                 struct error *err)
{
    const enum framesink_format k = s->opt.format;

    if (s->count == 0)
        return 0;
    if ((k == FRAMESINK_EXR || (k == FRAMESINK_PNG && s->out.file != stdout))
        && pattern_count(s->path) == 0)
        return error_set(err, EX_USAGE, "%s: frame %llu: the file holds one "
                         "picture (expected a pattern such as "
                         "frame-%%05d.%s%s)", s->path,
                         (unsigned long long)f->frame,
                         k == FRAMESINK_EXR ? "exr" : "png",
                         k == FRAMESINK_EXR ? "" : ", or .apng for an "
                         "animation");
    if ((k == FRAMESINK_Y4M || framesink_is_video(&s->opt) ||
         k == FRAMESINK_DEVICE)
        && (f->width != s->width || f->height != s->height))
        return error_set(err, EX_DATAERR, "%s: frame %llu: %zu x %zu pixels "
                         "(expected %zu x %zu, as the frames before)",
                         s->path, (unsigned long long)f->frame, f->width,
                         f->height, s->width, s->height);
    return 0;
}

/* A background picture of another size is brought to the frames' once; frames
 * that are not square have it resized as they are composed. */
static int framesink_fit_background(struct framesink *s,
                                    const struct framesink_frame *f,
                                    struct error *err)
{
    const struct background *bg = s->opt.background;

    if (f->width == s->fitted.width && f->height == s->fitted.height)
        return 0;
    background_release(&s->fitted);
    if (!bg || !bg->rgb || f->width != f->height ||
        (bg->width == f->width && bg->height == f->height))
        return 0;
    return background_fit(&s->fitted, bg, f->width, err);
}

int framesink_write(struct framesink *s, const struct framesink_frame *f,
                    struct error *err)
{
    const enum framesink_format k = s->opt.format;
    const int raw = k == FRAMESINK_EXR || (k == FRAMESINK_STREAM
                    && s->opt.record != FRAMESINK_IMAG);

    if (framesink_check_frame(s, f, err) != 0)
        return -1;
    if (s->opt.rate_num <= 0 || s->opt.rate_den <= 0) {
        s->opt.rate_num = 25;
        s->opt.rate_den = 1;
    }
    if (!raw && (s->count == 0 || f->width * f->height
                                  != s->width * s->height)) {
        free(s->pixel);
        s->pixel = malloc(5 * f->width * f->height);
        if (!s->pixel)
            return error_set(err, EX_OSERR, "out of memory for a picture of "
                             "%zu x %zu pixels", f->width, f->height);
    }
    if (!raw && framesink_fit_background(s, f, err))
        return -1;
    s->width = f->width;
    s->height = f->height;
    if (!raw && s->opt.alpha)
        framesink_compose_rgba(s->pixel, f);
    else if (!raw)
        framesink_compose(s->pixel, f, s->fitted.rgb ? &s->fitted
                                                     : s->opt.background);
    if (framesink_write_any(s, f, err) != 0)
        return -1;
    s->count++;
    return 0;
}

/* ---- ending ----------------------------------------------------------- */

/* Everything but what is still open. */
static void framesink_release(struct framesink *s)
{
    background_release(&s->fitted);
    if (s->opt.format == FRAMESINK_TERMINAL && s->count)
        terminal_end(stdout);
    v4l2_close(s->device);
    httpsink_close(s->http);
    free(s->pixel);
    free(s->planes);
    free(s->plane);
    free(s->half);
    covered_release(&s->covered);
    free(s->photo);
    free(s->part);
    free(s->sound);
    free(s->path);
    free(s);
}

int framesink_finish(struct framesink *s, struct error *err)
{
    int rc = 0;

    if (s->stream)
        rc = stream_finish(s->stream, err);
    s->stream = NULL;
    if (s->out.file)
        rc = outfile_close(&s->out, err);
    if (s->video) {
        rc = video_finish(s->video, s->end, err);
        s->video = NULL;
        if (rc == 0 && file_rename(s->part, s->path) != 0)
            rc = error_set(err, EX_CANTCREAT, "%s: cannot rename '%s': %s",
                           s->path, s->part, strerror(errno));
        if (rc != 0)
            unlink(s->part);
    }
    framesink_release(s);
    return rc;
}

void framesink_abandon(struct framesink *s)
{
    if (!s)
        return;
    if (s->stream)
        stream_abandon(s->stream);
    if (s->video) {
        video_finish(s->video, 0, NULL);
        if (s->count == 0)
            unlink(s->part);
    }
    if (s->out.part && s->count > 0 && !fflush(s->out.file)) {
        fclose(s->out.file);           /* complete frames: .part stays */
        free(s->out.part);
        free(s->out.path);
        memset(&s->out, 0, sizeof s->out);
    }
    outfile_abandon(&s->out);
    framesink_release(s);
}
