/* Rows of people, expressions and lights, rendered small. */
#include "lib/lab/people/sheet.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/lab/people/lens.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/stage.h"

enum { PEOPLE = 64, EXPRESSIONS = 24, LIGHTS = 12,
       CELLS = PEOPLE + EXPRESSIONS + LIGHTS };

/* The face of cell k of the expressions: the named directions one by one,
 * then jaw, lids and gaze. */
static void sheet_pull_face(struct synth_motion *m, int k, size_t nexp)
{
    memset(m->exp, 0, sizeof m->exp);
    memset(m->jaw, 0, sizeof m->jaw);
    memset(m->eye, 0, sizeof m->eye);
    m->lid[0] = m->lid[1] = 0.12f;
    if (k >= 1 && k <= 15 && (size_t)k <= nexp)
        m->exp[k - 1] = 1.8f;
    if (k == 16 && nexp > 1)
        m->exp[0] = m->exp[1] = 1.6f;
    if (k == 17 || k == 18)
        m->jaw[0] = k == 17 ? 0.18f : 0.40f;
    if (k == 18 && nexp > 8)
        m->exp[8] = 1.5f;
    if (k == 19 || k == 20)
        m->lid[0] = m->lid[1] = k == 19 ? 1.0f : 0.55f;
    if (k == 21)
        m->lid[1] = 1;
    if (k == 22 || k == 23)
        m->eye[1] = m->eye[4] = k == 22 ? 0.4f : -0.4f;
}

/* A person, an expression or a pose, by the number of the cell. */
static int sheet_draw_cell(struct stage *s, int cell, const struct head *head,
                           const struct synth_options *opt, struct error *err)
{
    size_t n = (size_t)opt->size;
    struct persona p;
    struct actor a;
    struct synth_motion m;
    float *wall = malloc(3 * n * n * sizeof *wall);

    if (!wall)
        return error_set(err, EX_OSERR, "out of memory for the sheet");
    persona_sample(&p, opt->seed, opt->first + (cell < PEOPLE
                   ? (uint64_t)cell : 0), head->nshape,
                   cell < PEOPLE ? opt->effects : 0);
    if (cell >= PEOPLE)
        p.yaw = p.pitch = p.roll = 0;
    if (cell >= PEOPLE + EXPRESSIONS)
        persona_relight(&p, cell - PEOPLE - EXPRESSIONS);
    int rc = actor_init(&a, head, &p, err);
    if (!rc) {
        synth_motion(&m, &p, 0, head->nexp, NULL);
        if (cell >= PEOPLE) {
            synth_still(&m, &p);
            sheet_pull_face(&m, cell < PEOPLE + EXPRESSIONS ? cell - PEOPLE : 0,
                            head->nexp);
        }
        rc = stage_render(s, &a, &m, err);
        backdrop_paint(wall, &p, opt->size);
        if (!rc)
            lens_expose(s, &p, wall, 0, 0, 0, 0);
        actor_release(&a);
    }
    free(wall);
    return rc;
}

struct sheet {
    uint8_t *rgb;
    struct stage *stage;        /* (parallel_width()) */
    const struct head *head;
    const struct synth_options *opt;
};

/* Cell i, drawn and put in its place. */
static int sheet_make_cell(void *ctx, size_t i, struct error *err)
{
    const struct sheet *c = ctx;
    const size_t n = (size_t)c->opt->size, row = 3 * n * SHEET_COLUMNS;
    struct stage *s = &c->stage[parallel_slot()];
    uint8_t *to = c->rgb + i / SHEET_COLUMNS * n * row +
                  i % SHEET_COLUMNS * 3 * n;

    if (sheet_draw_cell(s, (int)i, c->head, c->opt, err))
        return -1;
    for (size_t y = 0; y < n; y++)
        memcpy(to + y * row, s->rgb + 3 * n * y, 3 * n);
    return 0;
}

int synth_sheet(uint8_t *rgb, const struct head *head,
                const struct synth_options *opt, struct error *err)
{
    size_t n = (size_t)opt->size, row = 3 * n * SHEET_COLUMNS;
    int failed = 0, threads = parallel_width();
    struct stage *stage = calloc((size_t)threads, sizeof *stage);

    if (!stage)
        return error_set(err, EX_OSERR, "out of memory for the sheet");
    for (int i = 0; i < threads && !failed; i++)
        failed = stage_init(&stage[i], opt->size, err);
    noise_lattice();
    lens_init();
    memset(rgb, 0, row * n * SHEET_ROWS);
    if (!failed)
        failed = parallel_try(CELLS, sheet_make_cell,
                              &(struct sheet){rgb, stage, head, opt}, err);
    for (int i = 0; i < threads; i++)
        stage_release(&stage[i]);
    free(stage);
    return failed ? -1 : 0;
}
