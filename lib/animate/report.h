/* What a clip cost, beside the paper's figures. */
#ifndef SPID_ANIMATE_REPORT_H
#define SPID_ANIMATE_REPORT_H

#include <stdio.h>

#include "lib/animate/animate.h"
#include "lib/animate/prepare.h"

enum { REPORT_STAGES = 9 };

struct animate_report {
    const char *program;        /* NULL: "spid-animate" */
    size_t frames, lost, dropped, room;
    double begun, ended;        /* clock at the first and the last frame */
    float *ms[REPORT_STAGES];   /* (frames) of each stage */
    float *latency;             /* (frames) ms */
};

/* Add a frame. */
void animate_report_frame(struct animate_report *r,
                          const struct animate_frame *f);
/* Give a frame's times to a statistics module: begin() is a clock, end() adds
 * the time since `begun` to a stage. */
void animate_report_times(double (*begin)(void),
                          void (*end)(const char *stage, double begun),
                          const struct animate_frame *f);
/* Frames, frames a second; with stages a table of medians beside the paper's
 * (A100), with live the latency. */
void animate_report_print(FILE *to, struct animate_report *r,
                          const struct prepared *s, bool stages, bool live);
/* Free what it holds; zeroed then. */
void animate_report_release(struct animate_report *r);

#endif
