/* Means and spreads over many drawn people, as a table. */
#include "lib/lab/people/statistics.h"

#include <math.h>
#include <string.h>

struct tally {
    char name[24];
    double n, sum, square, lo, hi;
};
#define TALLIES 128

struct table {
    struct tally row[TALLIES];
    int count;
};

/* v joins the row of that name, which is made when new. */
static void statistics_add(struct table *t, const char *name, double v)
{
    int i = 0;

    while (i < t->count && strcmp(t->row[i].name, name))
        i++;
    if (i == TALLIES)
        return;
    struct tally *r = &t->row[i];
    if (i == t->count) {
        t->count++;
        *r = (struct tally){ .lo = v, .hi = v };
        snprintf(r->name, sizeof r->name, "%s", name);
    }
    r->n++;
    r->sum += v;
    r->square += v * v;
    r->lo = v < r->lo ? v : r->lo;
    r->hi = v > r->hi ? v : r->hi;
}

static void statistics_add_row(struct table *t, const char *name,
                               const float *v, int n)
{
    char full[24];

    for (int i = 0; i < n; i++) {
        snprintf(full, sizeof full, "%s[%d]", name, i);
        statistics_add(t, full, (double)v[i]);
    }
}

/* What a person adds to it. */
static void statistics_add_persona(struct table *t, const struct persona *p)
{
    double beta = 0, rest = 0;

    for (size_t i = 0; i < p->nbeta; i++)
        *(i < 50 ? &beta : &rest) += (double)p->beta[i] * (double)p->beta[i];
    statistics_add_row(t, "beta", p->beta, p->nbeta < 4 ? (int)p->nbeta : 4);
    statistics_add(t, "beta rms 0..49", sqrt(beta / 50));
    if (p->nbeta > 50)
        statistics_add(t, "beta rms 50..",
                       sqrt(rest / (double)(p->nbeta - 50)));
    statistics_add(t, "age", (double)p->age);
    statistics_add(t, "male", (double)p->male);
    statistics_add(t, "skin tone", (double)p->tone);
    statistics_add_row(t, "skin", p->skin.base, 3);
    statistics_add_row(t, "lip", p->skin.lip, 3);
    statistics_add_row(t, "hair", p->hair.color, 3);
    statistics_add(t, "hair style", p->hair.style);
    statistics_add(t, "hair gray", (double)p->hair.gray);
    statistics_add_row(t, "iris", p->eye.iris, 3);
    statistics_add(t, "pupil", (double)p->eye.pupil);
    statistics_add(t, "beard", (double)p->beard);
    statistics_add(t, "makeup", (double)p->makeup);
    statistics_add(t, "glasses", p->glasses != 0);
    statistics_add(t, "collar", p->collar);
    statistics_add_row(t, "cloth", p->cloth.base, 3);
    statistics_add_row(t, "key light", p->env.light[0].rgb, 3);
    statistics_add_row(t, "key from", p->env.light[0].dir, 3);
    statistics_add(t, "backdrop", p->backdrop);
    statistics_add(t, "exposure", (double)p->lens.exposure);
    statistics_add(t, "gamma", (double)p->lens.gamma);
    statistics_add(t, "noise", (double)p->lens.noise);
    statistics_add(t, "jpeg quality", p->lens.jpeg);
    statistics_add(t, "low resolution", (double)p->lens.low);
    statistics_add(t, "occluder", p->lens.occluder != 0);
}

/* What a motion adds to the table. */
static void statistics_add_motion(struct table *t, const struct synth_motion *m,
                                  size_t nexp)
{
    const float degrees = 57.29578f;
    double small = 0, named = 0, rest = 0;

    statistics_add(t, "yaw degrees", (double)(m->yaw * degrees));
    statistics_add(t, "pitch degrees", (double)(m->pitch * degrees));
    statistics_add(t, "roll degrees", (double)(m->roll * degrees));
    statistics_add_row(t, "trans", m->trans, 3);
    for (size_t i = 0; i < nexp; i++)
        *(i < 28 ? &named : i < 40 ? &small : &rest)
            += (double)m->exp[i] * (double)m->exp[i];
    statistics_add_row(t, "exp", m->exp, nexp < 4 ? (int)nexp : 4);
    statistics_add(t, "exp rms 0..27", sqrt(named / 28));
    statistics_add(t, "exp rms 28..39", sqrt(small / 12));
    statistics_add(t, "exp rms 40..", sqrt(rest / 60));
    statistics_add_row(t, "jaw", m->jaw, 3);
    statistics_add_row(t, "lid", m->lid, 2);
    statistics_add_row(t, "eye", m->eye, 6);
}

int synth_statistics(FILE *out, const struct head *head,
                     const struct synth_options *opt)
{
    static struct table t;
    static struct persona p;
    static struct synth_motion m;

    t.count = 0;
    for (uint64_t i = 0; i < opt->people; i++) {
        persona_sample(&p, opt->seed, opt->first + i, head->nshape,
                       opt->effects);
        statistics_add_persona(&t, &p);
        for (uint64_t f = 0; f < opt->frames; f++) {
            synth_motion(&m, &p, (double)f / opt->fps, head->nexp, NULL);
            statistics_add_motion(&t, &m, head->nexp);
        }
    }
    fprintf(out, "%-18s %9s %9s %9s %9s %9s\n", "parameter", "mean",
            "deviation", "least", "most", "values");
    for (int i = 0; i < t.count; i++) {
        const struct tally *r = &t.row[i];
        double mean = r->sum / r->n, var = r->square / r->n - mean * mean;
        fprintf(out, "%-18s %9.4f %9.4f %9.4f %9.4f %9.0f\n", r->name, mean,
                sqrt(var > 0 ? var : 0), r->lo, r->hi, r->n);
    }
    return ferror(out) ? -1 : 0;
}

void picture_figures(struct picture_figures *f, const unsigned char *rgb,
                     int w, int h)
{
    double n = (double)w * h, m = (double)(w - 1) * (h - 1);

    *f = (struct picture_figures){ 0 };
    for (int i = 0; i < w * h; i++)
        for (int k = 0; k < 3; k++) {
            double v = rgb[3 * i + k];
            f->mean[k] += v / n;
            f->deviation[k] += v * v / n;
        }
    for (int k = 0; k < 3; k++)
        f->deviation[k] = sqrt(fmax(f->deviation[k] - f->mean[k] * f->mean[k],
                                    0));
    for (int y = 0; y + 1 < h; y++)
        for (int x = 0; x + 1 < w; x++) {
            const unsigned char *p = rgb + 3 * (y * w + x) + 1;
            double g = hypot(p[3] - p[0], p[3 * w] - p[0]);
            int b = g < 1 ? 0 : 1 + (int)floor(log2(g));
            f->edge += g / m;
            f->bin[b > 7 ? 7 : b] += 1 / m;
        }
}

int synth_figures(struct picture_figures *f, const struct head *head,
                  const struct synth_options *opt, struct error *err)
{
    struct synth_options o = *opt;
    struct synth_frame frame;
    struct picture_figures one;
    double n = (double)(o.people = o.people < 64 ? o.people : 64);
    int rc;

    o.frames = 1;
    o.mesh = false;
    struct synth *s = synth_open(head, &o, err);
    if (!s)
        return -1;
    *f = (struct picture_figures){ 0 };
    while ((rc = synth_next(s, &frame, err)) > 0) {
        picture_figures(&one, frame.rgb, o.size, o.size);
        for (int k = 0; k < 3; k++) {
            f->mean[k] += one.mean[k] / n;
            f->deviation[k] += one.deviation[k] / n;
        }
        f->edge += one.edge / n;
        for (int k = 0; k < 8; k++)
            f->bin[k] += one.bin[k] / n;
    }
    synth_close(s);
    return rc;
}

void picture_print(FILE *out, const char *name,
                   const struct picture_figures *f)
{
    if (!f) {
        fprintf(out, "%-24s %17s %17s %6s %s\n", name, "mean r g b",
                "deviation", "edge", "% of gradients <1 <2 <4 ... <64, more");
        return;
    }
    fprintf(out, "%-24s %5.1f %5.1f %5.1f %5.1f %5.1f %5.1f %6.2f", name,
            f->mean[0], f->mean[1], f->mean[2], f->deviation[0],
            f->deviation[1], f->deviation[2], f->edge);
    for (int k = 0; k < 8; k++)
        fprintf(out, " %5.1f", 100 * f->bin[k]);
    fputc('\n', out);
}
