/* How far the head's arcs leave the straight lines, carried to the scans'
 * skin and teeth. */
#include "lib/lab/people/scan_follow.h"

#include <math.h>
#include <string.h>

#include "lib/head/arkit.h"
#include "lib/lab/people/scan_near.h"
#include "lib/base/vec3.h"

static const uint8_t rig[FOLLOW_RIGS] = {
    ARKIT_EYE_BLINK_L, ARKIT_EYE_BLINK_R, ARKIT_EYE_LOOK_DOWN_L,
    ARKIT_EYE_LOOK_DOWN_R, ARKIT_EYE_LOOK_IN_L, ARKIT_EYE_LOOK_IN_R,
    ARKIT_EYE_LOOK_OUT_L, ARKIT_EYE_LOOK_OUT_R, ARKIT_EYE_LOOK_UP_L,
    ARKIT_EYE_LOOK_UP_R, ARKIT_JAW_LEFT, ARKIT_JAW_OPENED, ARKIT_JAW_RIGHT
};

/* Only skin carries skin: eyeballs and the inside of the mouth do not. */
static bool follow_is_skin(const struct head *h, size_t i)
{
    return !h->region || (h->region[i] != REGION_EYEBALL
                          && h->region[i] != REGION_INNER_MOUTH);
}

int follow_map_init(struct follow_map *m, const struct scan_face *f,
                    const struct head *h, struct arena *memory,
                    struct error *err)
{
    struct near_tree g;
    struct arena room = {0};
    float *p = arena_take(&room, 3 * h->V, sizeof *p);
    int32_t *of = arena_take(&room, h->V, sizeof *of);
    size_t n = 0;

    *m = (struct follow_map){
        .head = h,
        .bind = arena_take(memory, 4 * FACE_NECK_END, sizeof *m->bind),
        .weight = arena_take(memory, 4 * FACE_NECK_END, sizeof *m->weight)
    };
    int rc = arena_check(memory, "the scans", err) ||
             arena_check(&room, "the scans", err);
    for (size_t i = 0; !rc && i < h->V; i++)
        if (follow_is_skin(h, i)) {
            copy3(p + 3 * n, h->v_template + 3 * i);
            of[n++] = (int32_t)i;
        }
    rc = rc || near_init(&g, p, n, &room, err);
    for (size_t i = 0; !rc && i < FACE_NECK_END; i++) {
        near_bind(m->bind + 4 * i, m->weight + 4 * i, &g, f->neutral + 3 * i);
        for (size_t k = 0; k < 4; k++)
            m->bind[4 * i + k] = of[m->bind[4 * i + k]];
    }
    arena_release(&room);
    return rc ? -1 : 0;
}

/* The head under weights w; joints: also what is a joint's. */
static void follow_pose(float *verts, const struct identity *id, const float *w,
                        bool joints)
{
    float exp[HEAD_MAX_EXP];
    struct head_motion m = {.exp = exp};

    arkit_to_motion(exp, (int)id->head->nexp, m.jaw, m.lid, m.eye, w);
    if (!joints) {
        memset(m.jaw, 0, sizeof m.jaw);
        memset(m.lid, 0, sizeof m.lid);
        memset(m.eye, 0, sizeof m.eye);
    }
    head_pose(verts, id, &m);
}

int follow_init(struct follow *o, const struct follow_map *m,
                const struct identity *id, struct arena *memory,
                struct error *err)
{
    size_t n = 3 * m->head->V;
    float *rest = arena_take(memory, n, sizeof *rest), w[ARKIT_COUNT] = {0};

    *o = (struct follow){.map = m, .id = id,
                         .full = arena_take(memory, FOLLOW_RIGS * n,
                                            sizeof *o->full)};
    if (arena_check(memory, "a person", err))
        return -1;
    follow_pose(rest, id, w, true);
    for (int k = 0; k < FOLLOW_RIGS; k++) {
        float *d = o->full + (size_t)k * n;
        w[rig[k]] = 1;
        follow_pose(d, id, w, true);
        w[rig[k]] = 0;
        for (size_t i = 0; i < n; i++)
            d[i] -= rest[i];
    }
    return 0;
}

/* Teeth, gums and tongue that the jaw carries turn with it. */
static void follow_bend_teeth(float *x, const struct follow *o,
                              const struct scan_face *f, const float *rest,
                              const float *w)
{
    const float *open = f->expression
                        + (size_t)ARKIT_JAW_OPENED * 3 * FACE_VERTICES;
    float joint[3], part[9], full[9], a = w[ARKIT_JAW_OPENED];

    for (int k = 0; k < 3; k++)
        joint[k] = (float)o->id->joints[3 * JOINT_JAW + k];
    axis33(part, 0, a * (float)ARKIT_JAW_OPEN);
    axis33(full, 0, (float)ARKIT_JAW_OPEN);
    for (size_t i = FACE_ORBIT_END; i < FACE_TEETH_END; i++) {
        const float *d = open + 3 * i;
        float p[3], q[3], r[3];
        sub3(p, rest + 3 * i, joint);
        rot3(q, part, p);
        rot3(r, full, p);
        sub3(q, q, p);
        sub3(r, r, p);
        float share = clampf(length3(d) / (length3(r) + 1e-6f), 0, 1);
        for (size_t k = 0; k < 3; k++)
            x[3 * i + k] += share * q[k] - a * share * r[k];
    }
}

void follow_bend(float *x, float *scratch, const struct follow *o,
                 const struct scan_face *f, const float *rest,
                 const float *verts, const float *w)
{
    const struct follow_map *m = o->map;
    size_t n = 3 * m->head->V;

    follow_pose(scratch, o->id, w, false);
    for (size_t i = 0; i < n; i++)
        scratch[i] = verts[i] - scratch[i];
    for (int k = 0; k < FOLLOW_RIGS; k++) {
        const float *d = o->full + (size_t)k * n;
        float a = w[rig[k]];
        for (size_t i = 0; a != 0 && i < n; i++)
            scratch[i] -= a * d[i];
    }
    for (size_t i = 0; i < FACE_NECK_END; i++)
        for (size_t k = 0; k < 4; k++)
            mad3(x + 3 * i, x + 3 * i, scratch + 3 * m->bind[4 * i + k],
                 m->weight[4 * i + k]);
    follow_bend_teeth(x, o, f, rest, w);
}
