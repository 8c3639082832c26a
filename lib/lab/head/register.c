/* The nearest points, and whether they are near. */
#include "lib/lab/head/register.h"

#include <math.h>
#include <sysexits.h>

#include "lib/base/vec3.h"
#include "lib/head/mirror.h"
#include "lib/lab/head/nearest.h"

#define FAR 0.02                /* metres: no match */
/* Metres, mean, within which a head lies on the scans: the built-in one does to
 * 0.19 mm, moved half a centimetre to 1.75. */
#define LIES 0.001

void match_point(double out[3], const struct match *m, const float *x)
{
    for (int c = 0; c < 3; c++) {
        out[c] = 0;
        for (int k = 0; k < 3; k++)
            out[c] += m->w[k] * x[3 * m->v[k] + c];
    }
}

/* How far the scans are to be followed at p: down the throat to where their
 * shoulders begin, at the back higher up. */
static float register_reach(const float p[3])
{
    float front = ramp(0, 0.05f, p[2]);

    return ramp(lerpf(-0.106f, -0.118f, front),
                lerpf(-0.082f, -0.096f, front), p[1]);
}

/* Every vertex's match; the eyeballs and what is near nothing have none. */
static int register_match(struct registration *r, const float *normal,
                          struct error *err)
{
    const struct template *s = r->s;
    struct nearest skin;
    double sum = 0;
    size_t n = 0;

    if (nearest_init(&skin, r->scan->neutral, r->scan->f, r->scan->nf,
                     &r->memory, err))
        return -1;
    for (size_t v = 0; v < s->nv; v++) {
        const float *x = s->v_template + 3 * v;
        const double p[3] = {x[0], x[1], x[2]};
        struct match *m = &r->match[v];
        struct nearest_hit hit;

        if (s->region[v] == REGION_EYEBALL ||
            !nearest_facing(&hit, &skin, p, normal + 3 * v, FAR))
            continue;
        for (int k = 0; k < 3; k++) {
            m->v[k] = skin.faces[3 * hit.face + k];
            m->w[k] = hit.bary[k];
        }
        m->trust = (double)register_reach(x);
        sum += m->trust * sqrt(hit.square);
        n++;
    }
    return n && sum < LIES * (double)n ? 0 : error_set(err, EX_DATAERR,
        "the head does not lie on the scans (expected the built-in one, or one "
        "made from it)");
}

int registration_init(struct registration *r, const struct template *s,
                      const struct scan *scan, struct error *err)
{
    struct arena *a = &r->memory;
    float *normal;

    *r = (struct registration){.s = s, .scan = scan};
    r->match = arena_take(a, s->nv, sizeof *r->match);
    r->mirror = arena_take(a, s->nv, sizeof *r->mirror);
    normal = arena_take(a, 3 * s->nv, sizeof *normal);
    if (arena_check(a, "a registration", err) ||
        surface_init(&r->mesh, s->f, s->nf, s->nv, a, err) ||
        mirror_vertices(r->mirror, s->v_template, s->nv, err))
        goto fail;
    surface_normals(normal, s->v_template, s->nv, s->f, s->nf);
    if (register_match(r, normal, err) == 0)
        return 0;
fail:
    registration_release(r);
    return -1;
}

void registration_release(struct registration *r)
{
    arena_release(&r->memory);
    *r = (struct registration){.s = NULL};
}
