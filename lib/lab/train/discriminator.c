/* A patch discriminator: verdicts, the hinge loss, and the gradient penalty
 * without second derivatives. */
#include "lib/lab/train/discriminator.h"

#include <math.h>
#include <string.h>

#define LAYERS DISCRIMINATOR_LAYERS
#define GAIN 1.387f             /* keeps the variance behind a slope of 0.2 */

const char *const discriminator_term_name[DISCRIMINATOR_TERMS] = {
    "hinge", "penalty"};

/* A verdict is about a patch of 38 pixels. */
static const struct {
    size_t out, kernel, stride;
} discriminator_layers[LAYERS] = {
    {32, 4, 2}, {64, 4, 2}, {128, 4, 2}, {1, 3, 1}
};

/* ---- making it ---------------------------------------------------------- */

/* Declare the tensors; a tangent's layer borrows the weight. */
static void discriminator_declare(struct discriminator *d)
{
    size_t in = 3;

    for (size_t i = 0; i < LAYERS; i++) {
        const size_t out = discriminator_layers[i].out;
        struct conv *c = &d->layer[i];
        char name[120];

        conv_init(c, &d->ps, nn_name(name, "discriminator.%zu", i), in, out,
                  discriminator_layers[i].kernel,
                  discriminator_layers[i].stride, true);
        c->pad = CONV_SAME;
        d->tangent[i] = *c;
        d->tangent[i].bias = NN_NONE;
        d->tangent[i].no_din = true;
        if (i + 1 < LAYERS) {
            c->act = ACT_LRELU;
            d->ps.tensor[c->weight].gain = GAIN;
        }
        in = out;
    }
}

/* Values of layer i's input, of i == LAYERS verdicts. */
static size_t discriminator_count(const struct discriminator *d, size_t i)
{
    const struct conv *c = &d->layer[i ? i - 1 : 0];

    return i ? c->oh * c->ow * c->out : c->h * c->w * c->in;
}

/* Layers and buffers for windows of d->side. */
static int discriminator_plan(struct discriminator *d, struct error *err)
{
    const struct nn_options opt = {NN_TRAIN, NN_F32};
    size_t h = d->side;

    nn_plan_init(&d->plan, opt);
    for (size_t i = 0; i < LAYERS; i++) {
        conv_plan(&d->layer[i], &d->plan, 1, h, h);
        conv_plan(&d->tangent[i], &d->plan, 1, h, h);
        h = d->layer[i].oh;
    }
    d->patches = h * h;
    for (size_t i = 0; i <= LAYERS; i++) {
        const size_t n = discriminator_count(d, i);

        d->x[i] = nn_plan_floats(&d->plan, n);
        d->g[i] = nn_plan_floats(&d->plan, n);
        if (i < LAYERS)
            d->t[i] = nn_plan_floats(&d->plan, n);
    }
    return nn_plan_finish(&d->plan, err);
}

int discriminator_init(struct discriminator *d, size_t image, uint64_t seed,
                       struct error *err)
{
    memset(d, 0, sizeof *d);
    d->image = image;
    d->side = image * 5 / 8 / 8 * 8;    /* a face with its outline */
    params_init(&d->ps);
    discriminator_declare(d);
    if (params_allocate(&d->ps, err) ||
        params_allocate_gradients(&d->ps, err)) {
        discriminator_release(d);
        return -1;
    }
    params_randomise(&d->ps, seed);
    if (discriminator_plan(d, err)) {
        discriminator_release(d);
        return -1;
    }
    return 0;
}

void discriminator_release(struct discriminator *d)
{
    nn_plan_release(&d->plan);
    params_release(&d->ps);
    memset(d, 0, sizeof *d);
}

/* ---- the window --------------------------------------------------------- */

/* Where the window of `side` about [from, to) begins inside of n pixels. */
static size_t discriminator_place(size_t from, size_t to, size_t side,
                                  size_t n)
{
    const size_t middle = (from + to) / 2;
    const size_t at = middle > side / 2 ? middle - side / 2 : 0;

    return at + side > n ? n - side : at;
}

/* Rows of the window about the face: pixels as they are, none in between. */
static size_t discriminator_row(const struct discriminator *d,
                                const struct box *face, size_t y)
{
    const size_t x0 = discriminator_place(face->x0, face->x1, d->side,
                                          d->image);
    const size_t y0 = discriminator_place(face->y0, face->y1, d->side,
                                          d->image);

    return 3 * ((y0 + y) * d->image + x0);
}

/* Verdicts on picture b. */
static void discriminator_forward(struct discriminator *d, const float *b,
                                  const struct box *face)
{
    const size_t line = 3 * d->side;

    for (size_t y = 0; y < d->side; y++) {
        const float *from = b + discriminator_row(d, face, y);

        for (size_t i = 0; i < line; i++)
            d->x[0][y * line + i] = 2 * from[i] - 1;
    }
    for (size_t i = 0; i < LAYERS; i++)
        conv_forward(d->x[i + 1], d->x[i], &d->layer[i]);
}

/* From the verdicts' gradient in d->g[LAYERS] to the window's. */
static void discriminator_to_window(struct discriminator *d)
{
    for (size_t i = LAYERS; i-- > 0;)
        conv_backward_input(d->g[i], d->g[i + 1], d->x[i + 1], &d->layer[i]);
}

/* ---- losses ------------------------------------------------------------- */

double discriminator_fool(float *db, const float *b, const struct box *face,
                          double weight, struct discriminator *d)
{
    const size_t line = 3 * d->side;
    double sum = 0;

    if (box_is_empty(*face))
        return 0;
    discriminator_forward(d, b, face);
    for (size_t i = 0; i < d->patches; i++) {
        sum += (double)d->x[LAYERS][i];
        d->g[LAYERS][i] = (float)(-weight / (double)d->patches);
    }
    discriminator_to_window(d);
    for (size_t y = 0; y < d->side; y++) {
        float *to = db + discriminator_row(d, face, y);

        for (size_t i = 0; i < line; i++)
            to[i] += 2 * d->g[0][y * line + i];
    }
    return -weight * sum / (double)d->patches;
}

/* scale * mean max(0, 1 - sign D) of the last forward, and its gradients. */
static double discriminator_hinge(struct discriminator *d, double sign,
                                  double scale)
{
    const double each = scale / (double)d->patches;
    double sum = 0;

    for (size_t i = 0; i < d->patches; i++) {
        const double miss = 1 - sign * (double)d->x[LAYERS][i];

        sum += fmax(0, miss);
        d->g[LAYERS][i] = miss > 0 ? (float)(-sign * each) : 0;
    }
    for (size_t i = LAYERS; i-- > 0;)
        conv_backward(i ? d->g[i] : NULL, d->g[i + 1], d->x[i + 1], d->x[i],
                      &d->layer[i]);
    return each * sum;
}

/* scale * gamma / 2 |v|^2 / patches of the last forward, v = d sum D / d x, and
 * its gradients.  The network is piecewise linear: with v held fixed, the
 * gradient of 1/2 |v|^2 by a weight is that of <v, d sum D / d x>, which is how
 * much D grows along v.  So a layer's weights have the gradient they always
 * have, of D's own backward, with the tangent v, carried that far through the
 * linearised network, in place of the layer's input.  Biases have none. */
static double discriminator_penalty(struct discriminator *d, double gamma,
                                    double scale)
{
    const double each = scale * gamma / (double)d->patches;
    const size_t n = discriminator_count(d, 0);
    double sum = 0;

    for (size_t i = 0; i < d->patches; i++)
        d->g[LAYERS][i] = 1;
    discriminator_to_window(d);
    for (size_t i = 0; i < n; i++) {
        sum += (double)d->g[0][i] * (double)d->g[0][i];
        d->t[0][i] = (float)(each * (double)d->g[0][i]);
    }
    for (size_t i = 0; i < LAYERS; i++) {
        conv_backward(NULL, d->g[i + 1], NULL, d->t[i], &d->tangent[i]);
        if (i + 1 == LAYERS)
            break;
        conv_forward(d->t[i + 1], d->t[i], &d->tangent[i]);
        act_backward_out(d->t[i + 1], d->t[i + 1], d->x[i + 1],
                         d->layer[i].act, discriminator_count(d, i + 1));
    }
    return 0.5 * each * sum;
}

void discriminator_learn(double terms[DISCRIMINATOR_TERMS], const float *b,
                         const float *a, const struct box *face, double gamma,
                         double scale, struct discriminator *d)
{
    if (box_is_empty(*face))
        return;
    discriminator_forward(d, b, face);
    terms[DISCRIMINATOR_HINGE] += discriminator_hinge(d, -1, scale);
    discriminator_forward(d, a, face);
    terms[DISCRIMINATOR_HINGE] += discriminator_hinge(d, 1, scale);
    if (gamma > 0)
        terms[DISCRIMINATOR_PENALTY] += discriminator_penalty(d, gamma, scale);
}
