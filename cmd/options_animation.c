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
        notice("%s: without the sound of %s (expected .mp4 .mov .mkv or .webm "
               "for it)", strcmp(a->output, "-") ? a->output : "<stdout>",
               a->driver_name);
    if (a->sound_lost)
        notice("%s: without sound: the clip that %s was made of is not there",
               a->output, a->driver_name);
    for (size_t i = 0; i < sizeof ending / sizeof *ending; i++)
        if (file_ends(a->output, ending[i]) && stat(a->output, &st) == 0)
            notice("%s: %zu frame%s in %.1f MB", a->output,
                   a->report.frames, plural(a->report.frames),
                   (double)st.st_size / 1e6);
}

void option_sound_tell(const struct framesink *s)
{
    const char *clip = framesink_lost_sound(s);

    if (clip)
        notice("%s: without sound: %s is not there", cli.output, clip);
}
