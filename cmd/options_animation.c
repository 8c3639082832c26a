/* What spid-animate and spid-live do with their options, apart from the others:
 * it links the whole of lib/animate. */
#include <string.h>
#include <sys/stat.h>

#include "cmd/options.h"
#include "lib/animate/animation.h"
#include "lib/base/file.h"
#include "lib/base/parallel.h"

void option_animation_load(struct prepare *models,
                           struct animation_options *opt)
{
    char model[4096], head[4096];
    struct error err = {0};

    option_precision_settle(&opt->animate.pipeline.precision);
    if (cli_find_model("model.safetensors", model, sizeof model, &err) ||
        (!opt->head && cli_find_model("head.safetensors", head, sizeof head,
                                      &err)) ||
        animation_load(models, opt, model, opt->head ? opt->head : head,
                       parallel_width(), &err))
        die_error(&err);
}

void option_animation_done(const struct animation *a)
{
    static const char *const ending[] = {".gif", ".webp", ".apng"};
    struct stat st;

    if (a->silent && !a->opt->no_sound)
        notice("%s: without the sound of %s (%s)",
               strcmp(a->output, "-") ? a->output : "<stdout>", a->driver_name,
               a->opt->live ? "a live picture has none"
                            : "expected .mp4 .mov .mkv or .webm for it");
    if (a->sound_lost)
        notice("%s: without sound: the clip that %s was made of is not there",
               a->output, a->driver_name);
    for (size_t i = 0; i < sizeof ending / sizeof *ending; i++)
        if (file_ends(a->output, ending[i]) && stat(a->output, &st) == 0)
            notice("%s: %zu frames in %.1f MB", a->output, a->report.frames,
                   (double)st.st_size / 1e6);
}

void option_sound_tell(const struct framesink *s)
{
    const char *clip = framesink_lost_sound(s);

    if (clip)
        notice("%s: without sound: %s is not there", cli.output, clip);
}

void option_faces_tell(const char *name, const struct track_faces *faces,
                       const char *option)
{
    char at[TRACK_FACES * 40] = "";
    size_t n = 0;

    if (faces->n < 2)
        return;
    for (size_t i = 0; i < faces->n; i++)
        n += (size_t)snprintf(at + n, sizeof at - n, "%s%zu at %.0f,%.0f,%.0f",
                              i ? ", " : "", i + 1, faces->crop[i].x,
                              faces->crop[i].y, faces->crop[i].size);
    notice("%s: %zu faces (%s): number %zu is taken (--%s N takes another)",
           name, faces->n, at, faces->chosen + 1, option);
}

void option_animation_warn(const char *name, const struct animate_frame *f)
{
    const unsigned long long n = f->index;

    if (f->track->event == TRACK_LOST)
        warn("%s: frame %llu: face lost (%s); holding the last motion", name,
             n, f->track->why);
    else if (f->track->event == TRACK_FOUND)
        warn("%s: frame %llu: face found again", name, n);
}
