/* The light on a head from one picture of it: found again on half a sphere of
 * skin that is shaded by it, also where another third is hair, or black; no
 * light where nothing is seen or all is as bright. */
#include <math.h>
#include <string.h>

#include "lib/avatar/light.h"
#include "lib/base/random.h"
#include "tests/check.h"

#define V 3000

struct skin {
    float rgba[4 * V], normal[3 * V], weight[V];
};

/* Normals all over the sphere; those that look away are not seen. */
static void light_paint(struct skin *s, const double l[3], struct random *r)
{
    static const double color[3] = {0.5, 0.3, 0.22};    /* linear */

    for (size_t v = 0; v < V; v++) {
        double n[3], size = 1e-9, light = 1;

        for (int c = 0; c < 3; c++) {
            n[c] = random_normal(r);
            size += n[c] * n[c];
        }
        for (int c = 0; c < 3; c++) {
            s->normal[3 * v + c] = (float)(n[c] / sqrt(size));
            light += l[c] * n[c] / sqrt(size);
        }
        light = fmax(light, 0) * random_range(r, 0.9, 1.1);
        for (int c = 0; c < 3; c++)
            s->rgba[4 * v + c] = (float)pow(color[c] * light, 1 / 2.2);
        s->rgba[4 * v + 3] = 1;
        s->weight[v] = s->normal[3 * v + 2] > 0;
    }
}

static double light_off(const float l[3], const double want[3])
{
    double d = 0;

    for (int c = 0; c < 3; c++)
        d = fmax(d, fabs((double)l[c] - want[c]));
    return d;
}

/* Every third vertex is hair: darker, of another colour, bright to one side. */
static void grow_hair(struct skin *s)
{
    static const float color[3] = {0.5f, 0.3f, 0.1f};

    for (size_t v = 0; v < V; v += 3)
        for (int c = 0; c < 3; c++)
            s->rgba[4 * v + c] = color[c] * (0.5f + 0.4f *
                                             s->normal[3 * v]);
}

int main(void)
{
    static struct skin s;
    static float tmp[4 * V];
    static const double want[3] = {-0.4, 0.3, 0.5}, none[3] = {0, 0, 0};
    static const double strong[3] = {0.9, 0, 2};
    struct random r;
    float l[3];

    random_init(&r, 5, "light");
    light_paint(&s, want, &r);
    light_fit(l, s.rgba, s.normal, s.weight, V, tmp);
    check("skin alone", light_off(l, want), 0.02);
    grow_hair(&s);
    light_fit(l, s.rgba, s.normal, s.weight, V, tmp);
    check("a third is hair", light_off(l, want), 0.05);
    light_paint(&s, want, &r);
    for (size_t v = 0; v < V; v += 3)
        memset(s.rgba + 4 * v, 0, 3 * sizeof *s.rgba);
    light_fit(l, s.rgba, s.normal, s.weight, V, tmp);
    check("a third is black", light_off(l, want), 0.02);
    light_paint(&s, none, &r);
    light_fit(l, s.rgba, s.normal, s.weight, V, tmp);
    check("the same light from everywhere", light_off(l, none), 0.02);
    light_paint(&s, strong, &r);
    light_fit(l, s.rgba, s.normal, s.weight, V, tmp);
    check("no longer than 1", hypot(hypot((double)l[0], (double)l[1]),
                                    (double)l[2]) - 1, 1e-6);
    check("and not the other way", -(double)l[2], 0);
    memset(s.weight, 0, sizeof s.weight);
    light_fit(l, s.rgba, s.normal, s.weight, V, tmp);
    check("nothing is seen", light_off(l, none), 0);
    return check_status();
}
