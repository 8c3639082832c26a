/* What spid-animate and spid-live do with their options, apart from the others:
 * it links the whole of lib/animate. */
#include "cmd/options.h"
#include "lib/animate/animation.h"
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

void option_animation_warn(const char *name, const struct animate_frame *f)
{
    const unsigned long long n = f->index;

    if (f->track->event == TRACK_LOST)
        warn("%s: frame %llu: face lost (%s); holding the last motion", name,
             n, f->track->why);
    else if (f->track->event == TRACK_FOUND)
        warn("%s: frame %llu: face found again", name, n);
}
