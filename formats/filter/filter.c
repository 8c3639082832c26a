/* ffmpeg's filters, in a module of their own: frames in and out of a graph
 * (formats/module.h). */
#include <stdio.h>
#include <stdlib.h>

#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>

#include "formats/module.h"

struct filter {
    AVFilterGraph *graph;
    AVFilterContext *in, *out;
    AVRational step;            /* of the times that come and go */
};

static void filter_close(struct filter *f)
{
    if (f)
        avfilter_graph_free(&f->graph);
    free(f);
}

/* The two ends of the graph; a libav error number. */
static int filter_make_ends(struct filter *f, const AVFrame *like)
{
    const AVRational sar = like->sample_aspect_ratio;
    char text[256];
    int rc;

    snprintf(text, sizeof text, "video_size=%dx%d:pix_fmt=%d:time_base=%d/%d:"
             "pixel_aspect=%d/%d", like->width, like->height, like->format,
             f->step.num, f->step.den, sar.num, sar.den > 0 ? sar.den : 1);
    rc = avfilter_graph_create_filter(&f->in, avfilter_get_by_name("buffer"),
                                      "in", text, NULL, f->graph);
    if (rc < 0)
        return rc;
    return avfilter_graph_create_filter(&f->out,
                                        avfilter_get_by_name("buffersink"),
                                        "out", NULL, NULL, f->graph);
}

/* The graph between them; a libav error number. */
static int filter_link(struct filter *f, const char *graph)
{
    AVFilterInOut *from = avfilter_inout_alloc(), *to = avfilter_inout_alloc();
    int rc = AVERROR(ENOMEM);

    if (from && to) {
        from->name = av_strdup("in");
        from->filter_ctx = f->in;
        to->name = av_strdup("out");
        to->filter_ctx = f->out;
        rc = avfilter_graph_parse_ptr(f->graph, graph, &to, &from, NULL);
    }
    avfilter_inout_free(&from);
    avfilter_inout_free(&to);
    return rc < 0 ? rc : avfilter_graph_config(f->graph, NULL);
}

static struct filter *filter_open(const char *graph, const AVFrame *like,
                                  int num, int den)
{
    struct filter *f = calloc(1, sizeof *f);

    if (!f)
        return NULL;
    f->step = (AVRational){num, den};
    f->graph = avfilter_graph_alloc();
    if (f->graph)
        f->graph->nb_threads = 1;       /* the same on any machine */
    if (f->graph && filter_make_ends(f, like) >= 0 &&
        filter_link(f, graph) >= 0)
        return f;
    filter_close(f);
    return NULL;
}

static int filter_send(struct filter *f, AVFrame *frame)
{
    const AVFilterLink *is = f->in->outputs[0];

    if (frame && (frame->width != is->w || frame->height != is->h ||
                  frame->format != is->format))
        return AVERROR_INPUT_CHANGED;
    return av_buffersrc_add_frame(f->in, frame);
}

static int filter_receive(struct filter *f, AVFrame *frame)
{
    const int rc = av_buffersink_get_frame(f->out, frame);

    if (rc >= 0 && frame->pts != AV_NOPTS_VALUE)
        frame->pts = av_rescale_q(frame->pts,
                                  av_buffersink_get_time_base(f->out),
                                  f->step);
    return rc;
}

extern const struct filter_module spid_filter;

__attribute__((visibility("default"))) const struct filter_module spid_filter =
    {filter_open, filter_send, filter_receive, filter_close};
