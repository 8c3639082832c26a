/* Both surfaces posed alike, and the distances between them part by part. */
#include "lib/lab/head/compare.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/random.h"
#include "lib/base/sort.h"
#include "lib/head/arkit.h"
#include "lib/head/lbs.h"
#include "lib/lab/head/nearest.h"

/* A random face's weights, as compare_faces says. */
static void compare_sample(float *identity, float *arkit, uint64_t seed,
                           int person, double active)
{
    struct random r;

    random_init(&r, seed * 1000003 + (uint64_t)person, "head compare");
    for (int k = 0; k < SCAN_IDENTITIES; k++)
        identity[k] = (float)random_normal(&r);
    for (int k = 0; k < ARKIT_COUNT; k++) {
        double on = random_range(&r, 0, 1), much = random_range(&r, 0, 1);

        arkit[k] = on < active ? (float)much : 0;
    }
    arkit_draw_side(arkit, &r);
}

/* verts (SCAN_VERTS,3) = the scans' face, head units. */
static void compare_scan(float *verts, const struct scan *s,
                         const float *identity, const float *arkit,
                         float scale)
{
    const size_t row = 3 * (size_t)SCAN_VERTS;

    memcpy(verts, s->neutral, row * sizeof *verts);
    for (size_t k = 0; k < SCAN_IDENTITIES + ARKIT_COUNT; k++) {
        float w = k < SCAN_IDENTITIES ? identity[k]
                                      : arkit[k - SCAN_IDENTITIES];
        const float *d = k < SCAN_IDENTITIES ? s->identity + k * row
                       : s->expression + (k - SCAN_IDENTITIES) * row;

        for (size_t i = 0; w != 0 && i < row; i++)
            verts[i] += w * d[i];
    }
    for (size_t i = 0; i < row; i++)
        verts[i] *= scale;
}

/* ---- which vertices count ----------------------------------------------- */

enum { FACE, LIDS, LIPS, REST };

/* part (SCAN_SKIN): lids and lips are what lies nearest to ours, face the
 * narrow face, -1 what no one sees: nostrils' and mouth's insides, and what
 * lies below the template's trusted neck. */
static int compare_label_parts(int *part, const struct head *h,
                               const struct scan *s, struct error *err)
{
    enum { NARROW = 6706 };
    struct arena room = {0};
    struct nearest t;
    double unit = h->scale;

    if (nearest_init(&t, h->v_template, h->f, h->F, &room, err)) {
        arena_release(&room);
        return -1;
    }
    for (int32_t v = 0; v < SCAN_SKIN; v++) {
        const float *q = s->neutral + 3 * v;
        double p[3] = {unit * q[0], unit * q[1], unit * q[2]};
        struct nearest_hit hit;

        nearest_find(&hit, &t, p, 1);
        int32_t region = h->region ? h->region[h->f[3 * hit.face]]
                                   : REGION_FACE;
        part[v] = region == REGION_EYELID ? LIDS
                : region == REGION_LIPS ? LIPS
                : region == REGION_INNER_MOUTH ? -1
                : region == REGION_EYEBALL ? LIDS
                : region == REGION_NOSE && sqrt(hit.square) > 0.004 * unit ? -1
                : q[1] < -0.095 ? -1
                : v < NARROW ? FACE : REST;
    }
    arena_release(&room);
    return 0;
}

/* Faces that show skin: all but the eyeballs'. */
static size_t compare_skin_faces(int32_t *f, const struct head *h)
{
    size_t n = 0;

    for (size_t i = 0; i < h->F; i++)
        if (!h->region || h->region[h->f[3 * i]] != REGION_EYEBALL)
            memcpy(f + 3 * n++, h->f + 3 * i, 3 * sizeof *f);
    return n;
}

/* One person's posed head and the scans' face, head units. */
static int compare_pose_both(float *ours, float *theirs, const struct head *h,
                             const struct scan *s, uint64_t seed, int person,
                             double active, struct error *err)
{
    float identity[SCAN_IDENTITIES], arkit[ARKIT_COUNT];
    float exp[HEAD_MAX_EXP];
    struct head_motion m = {.exp = exp};
    struct identity id;

    compare_sample(identity, arkit, seed, person, active);
    arkit_to_motion(exp, (int)h->nexp, m.jaw, m.lid, m.eye, arkit);
    if (head_fold(&id, h, identity, SCAN_IDENTITIES, err))
        return -1;
    head_pose(ours, &id, &m);
    identity_release(&id);
    compare_scan(theirs, s, identity, arkit, h->scale);
    return 0;
}

/* Mean, 95th percentile and largest of n distances, which it sorts. */
static void compare_summarise(struct compare_part *p, float *d, size_t n)
{
    double sum = 0;

    sort_floats(d, n);
    for (size_t i = 0; i < n; i++)
        sum += d[i];
    p->mean = n ? sum / (double)n : 0;
    p->p95 = n ? d[(n - 1) * 95 / 100] : 0;
    p->worst = n ? d[n - 1] : 0;
}

/* Millimetres from each labelled vertex of a scan (SCAN_VERTS,3) to our skin,
 * after those that are in d (COMPARE_PARTS,all); count[k]: in part k. */
static void compare_measure(float *d, size_t count[COMPARE_PARTS], size_t all,
                            const struct nearest *t, const float *theirs,
                            const int *label, double scale)
{
    for (int32_t v = 0; v < SCAN_SKIN; v++) {
        double p[3] = {theirs[3 * v], theirs[3 * v + 1], theirs[3 * v + 2]};
        struct nearest_hit hit;

        if (label[v] < 0)
            continue;
        nearest_find(&hit, t, p, 1e3);
        d[(size_t)label[v] * all + count[label[v]]++] =
            (float)(1e3 / scale * sqrt(hit.square));
    }
}

/* Whether the head has the scans' directions. */
static int compare_check_head(const struct head *h, struct error *err)
{
    if (h->nshape >= SCAN_IDENTITIES && h->nexp >= ARKIT_COUNT)
        return 0;
    return error_set(err, EX_DATAERR, "head has %zu shape and %zu expression "
                     "directions (expected at least %d and %d)", h->nshape,
                     h->nexp, SCAN_IDENTITIES, ARKIT_COUNT);
}

int compare_faces(struct compare_part part[COMPARE_PARTS],
                  const struct head *h, const struct scan *s, int people,
                  double active, uint64_t seed, struct error *err)
{
    static const char *const names[COMPARE_PARTS] = {
        "face", "lids", "lips", "head and ears" };
    size_t row = 3 * (size_t)SCAN_VERTS, all = (size_t)people * SCAN_SKIN;
    struct arena room = {0};
    float *ours = arena_take(&room, 3 * h->V, sizeof *ours);
    float *theirs = arena_take(&room, row, sizeof *theirs);
    float *d = arena_take(&room, COMPARE_PARTS * all, sizeof *d);
    int32_t *skin = arena_take(&room, 3 * h->F, sizeof *skin);
    int *label = arena_take(&room, SCAN_SKIN, sizeof *label), rc = -1;
    size_t count[COMPARE_PARTS] = {0};
    struct nearest t;

    if (compare_check_head(h, err) || arena_check(&room, "faces", err))
        goto out;
    memcpy(ours, h->v_template, 3 * h->V * sizeof *ours);
    if (compare_label_parts(label, h, s, err) ||
        nearest_init(&t, ours, skin, compare_skin_faces(skin, h), &room, err))
        goto out;
    for (int i = 0; i < people; i++) {
        if (compare_pose_both(ours, theirs, h, s, seed, i, active, err))
            goto out;
        nearest_update(&t);
        compare_measure(d, count, all, &t, theirs, label, h->scale);
    }
    for (int k = 0; k < COMPARE_PARTS; k++) {
        part[k].name = names[k];
        part[k].n = count[k] / (size_t)people;
        compare_summarise(&part[k], d + (size_t)k * all, count[k]);
    }
    rc = 0;
out:
    arena_release(&room);
    return rc;
}
