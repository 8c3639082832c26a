/* Points halved again and again, along one axis after the other: the middle one
 * of a piece of the list splits it, and those before it lie lower. */
#include "lib/lab/people/scan_near.h"

#include "lib/base/vec3.h"

/* Number k of item[from,to) by x, the points' coordinates along an axis, to
 * its place; lower ones before it (Hoare's selection). */
static void near_select(int32_t *item, int from, int to, int k, const float *x)
{
    for (to--; from < to;) {
        const float split = x[3 * item[k]];
        int i = from, j = to;

        while (i <= j) {
            while (x[3 * item[i]] < split)
                i++;
            while (x[3 * item[j]] > split)
                j--;
            if (i <= j) {
                const int32_t swap = item[i];

                item[i++] = item[j];
                item[j--] = swap;
            }
        }
        from = j < k ? i : from;
        to = k < i ? j : to;
    }
}

static void near_split(struct near_tree *t, int from, int to, int axis)
{
    const int middle = (from + to) / 2, next = (axis + 1) % 3;

    if (to - from < 2)
        return;
    near_select(t->item, from, to, middle, t->p + axis);
    near_split(t, from, middle, next);
    near_split(t, middle + 1, to, next);
}

int near_init(struct near_tree *t, const float *p, size_t n,
              struct arena *memory, struct error *err)
{
    *t = (struct near_tree){.p = p, .n = n};
    t->item = arena_take(memory, n, sizeof *t->item);
    if (arena_check(memory, "points", err))
        return -1;
    for (size_t i = 0; i < n; i++)
        t->item[i] = (int32_t)i;
    near_split(t, 0, (int)n, 0);
    return 0;
}

/* What is looked for, and the nearest so far, in order. */
struct near_search {
    const struct near_tree *t;
    const float *x, *n;
    int k, have;
    float limit, d2[NEAR_MAX];
    int32_t *index;
};

/* Point i, if it is near enough and its normal agrees. */
static void near_take(struct near_search *s, int32_t i)
{
    const float *normal = s->t->normal;
    float d[3], l;
    int at = s->have < s->k ? s->have : s->k - 1;

    sub3(d, s->t->p + 3 * i, s->x);
    l = dot3(d, d);
    if (l > s->limit || (s->have == s->k && l >= s->d2[at])
        || (s->n && normal && dot3(s->n, normal + 3 * i) < 0.5f))
        return;
    for (; at > 0 && s->d2[at - 1] > l; at--) {
        s->d2[at] = s->d2[at - 1];
        s->index[at] = s->index[at - 1];
    }
    s->d2[at] = l;
    s->index[at] = i;
    s->have += s->have < s->k;
}

/* The side on which x lies first; the other one where something on it may be
 * nearer than what there is. */
static void near_look(struct near_search *s, int from, int to, int axis)
{
    const int middle = (from + to) / 2, next = (axis + 1) % 3;

    if (from >= to)
        return;
    const int32_t i = s->t->item[middle];
    const float across = s->x[axis] - s->t->p[3 * i + axis];
    const bool low = across < 0;

    near_look(s, low ? from : middle + 1, low ? middle : to, next);
    near_take(s, i);
    if (across * across <= (s->have < s->k ? s->limit : s->d2[s->k - 1]))
        near_look(s, low ? middle + 1 : from, low ? to : middle, next);
}

int near_find(int32_t *index, float *d2, const struct near_tree *t,
              const float x[3], const float *n, int k, float reach)
{
    struct near_search s = {
        .t = t, .x = x, .n = n, .k = k > NEAR_MAX ? NEAR_MAX : k,
        .limit = reach * reach, .index = index
    };

    near_look(&s, 0, (int)t->n, 0);
    for (int i = 0; d2 && i < s.have; i++)
        d2[i] = s.d2[i];
    return s.have;
}

void near_bind(int32_t index[4], float weight[4], const struct near_tree *t,
               const float x[3])
{
    float d2[4], sum = 0;
    int have = near_find(index, d2, t, x, NULL, 4, 1e3f);

    for (int i = 0; i < 4; i++) {
        if (i >= have)
            index[i] = index[0];
        weight[i] = i < have ? 1 / (d2[i] + 1e-5f) : 0;
        sum += weight[i];
    }
    for (int i = 0; i < 4; i++)
        weight[i] /= sum;
}
