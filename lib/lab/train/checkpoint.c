/* Checkpoints as safetensors, and joining the tensors of several model files
 * into one. */
#include "lib/lab/train/checkpoint.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/safetensors.h"
#include "lib/base/half.h"
#include "lib/base/list.h"
#include "lib/base/random.h"

/* x into a digest. */
static uint64_t checkpoint_mix(uint64_t h, uint64_t x)
{
    return random_mix(h ^ x);
}

/* Names, shapes and freezes of tensors into a digest. */
static uint64_t checkpoint_mix_tensors(uint64_t h, const struct params *ps)
{
    for (size_t i = 0; i < ps->count; i++) {
        const struct param *p = &ps->tensor[i];
        h = checkpoint_mix(h, random_name(p->name));
        h = checkpoint_mix(h, p->frozen);
        for (int k = 0; k < p->ndim; k++)
            h = checkpoint_mix(h, p->dim[k]);
    }
    return h;
}

void checkpoint_fingerprint(char text[17], const struct train_config *c,
                            const struct params *ps,
                            const struct params *opponent)
{
    uint64_t h = checkpoint_mix(random_name(train_stage_name(c->stage)),
                                (uint64_t)c->seed);

    h = checkpoint_mix(h, (uint64_t)c->batch);
    h = checkpoint_mix(h, (uint64_t)c->micro);
    h = checkpoint_mix(h, (uint64_t)c->pool);
    h = checkpoint_mix(h, (uint64_t)(c->people_per_step * 1e6));
    h = checkpoint_mix_tensors(h, ps);
    if (opponent)
        h = checkpoint_mix_tensors(h, opponent);
    snprintf(text, 17, "%016" PRIx64, h);
}

/* n floats as a tensor. */
static struct st_tensor checkpoint_block(const char *name, const float *x,
                                         size_t n)
{
    struct st_tensor t = {.name = name, .dtype = ST_F32, .ndim = 1,
                          .dim = {n}, .count = n, .data = x};

    return t;
}

/* What a part has to say; names of the opponent's tensors begin with it. */
static const struct {
    const char *w, *m, *v, *average, *updates;
} checkpoint_names[2] = {
    {"w", "m", "v", "average", "updates"},
    {"opponent.w", "opponent.m", "opponent.v", "opponent.average",
     "opponent.updates"}
};

/* A part's tensors into t; how many. */
static size_t checkpoint_part_tensors(struct st_tensor t[4],
                                      const struct checkpoint_part *p,
                                      int which)
{
    const struct adam *a = p->adam;
    size_t n = 0;

    if (!p->ps)
        return 0;
    t[n++] = checkpoint_block(checkpoint_names[which].w, p->ps->w,
                              p->ps->total);
    t[n++] = checkpoint_block(checkpoint_names[which].m, a->m, a->total);
    t[n++] = checkpoint_block(checkpoint_names[which].v, a->v, a->total);
    if (a->average)
        t[n++] = checkpoint_block(checkpoint_names[which].average, a->average,
                                  a->total);
    return n;
}

int checkpoint_save(const char *path, const struct checkpoint *c,
                    struct error *err)
{
    struct st_tensor t[8];
    char s[24], k[24], u[24], o[24];
    const char *meta[] = {"spid-train", c->fingerprint, "step", s, "skipped",
                          k, checkpoint_names[0].updates, u,
                          c->opponent.ps ? checkpoint_names[1].updates : NULL,
                          o, NULL};
    size_t n = checkpoint_part_tensors(t, &c->model, 0);

    n += checkpoint_part_tensors(t + n, &c->opponent, 1);
    snprintf(s, sizeof s, "%" PRIu64, c->step);
    snprintf(k, sizeof k, "%" PRIu64, c->skipped);
    snprintf(u, sizeof u, "%" PRIu64, c->model.adam->step);
    snprintf(o, sizeof o, "%" PRIu64,
             c->opponent.ps ? c->opponent.adam->step : 0);
    return st_save(path, t, n, meta, err);
}

/* A tensor of n floats of the file. */
static int checkpoint_take(float *out, const struct safetensors *st,
                           const char *name, size_t n, struct error *err)
{
    const struct st_tensor *t = st_find(st, name);

    if (!t || t->dtype != ST_F32 || t->count != n)
        return error_set(err, EX_DATAERR, "%s: tensor %s is missing or of "
                         "another size (expected F32 [%zu])", st_path(st),
                         name, n);
    memcpy(out, t->data, n * sizeof *out);
    return 0;
}

/* A number of the metadata, 0 without it. */
static uint64_t checkpoint_number(const struct safetensors *st,
                                  const char *key)
{
    const char *s = st_meta(st, key);

    return s ? strtoull(s, NULL, 10) : 0;
}

/* A part's tensors and updates. */
static int checkpoint_take_part(struct checkpoint_part *p,
                                const struct safetensors *st, int which,
                                struct error *err)
{
    struct adam *a = p->adam;

    if (!p->ps)
        return 0;
    if (checkpoint_take(p->ps->w, st, checkpoint_names[which].w, p->ps->total,
                        err) ||
        checkpoint_take(a->m, st, checkpoint_names[which].m, a->total, err) ||
        checkpoint_take(a->v, st, checkpoint_names[which].v, a->total, err) ||
        (a->average &&
         checkpoint_take(a->average, st, checkpoint_names[which].average,
                         a->total, err)))
        return -1;
    a->step = checkpoint_number(st, checkpoint_names[which].updates);
    return 0;
}

int checkpoint_load(const char *path, struct checkpoint *c, struct error *err)
{
    struct safetensors *st;
    const char *print;
    int rc = -1;

    if (access(path, F_OK))
        return 0;
    st = st_open(path, err);
    if (!st)
        return -1;
    print = st_meta(st, "spid-train");
    if (!print || strcmp(print, c->fingerprint)) {
        error_set(err, EX_CONFIG, "%s: checkpoint of another configuration "
                  "(%s, expected %s)", path, print ? print : "none",
                  c->fingerprint);
        goto out;
    }
    if (checkpoint_take_part(&c->model, st, 0, err) ||
        checkpoint_take_part(&c->opponent, st, 1, err))
        goto out;
    c->step = checkpoint_number(st, "step");
    c->skipped = checkpoint_number(st, "skipped");
    rc = 1;
out:
    st_close(st);
    return rc;
}

int checkpoint_source_parse(struct checkpoint_source *s, const char *text,
                            struct error *err)
{
    char *copy = strdup(text), *colon, *equals;

    if (!copy)
        return error_set(err, EX_OSERR, "out of memory");
    colon = strrchr(copy, ':');
    if (colon)
        *colon++ = 0;
    equals = colon ? strchr(colon, '=') : NULL;
    if (equals)
        *equals++ = 0;
    *s = (struct checkpoint_source){
        .path = copy, .prefix = colon ? colon : "",
        .from = equals ? equals : colon ? colon : ""};
    return 0;
}

int checkpoint_import(struct params *ps, const struct checkpoint_source *s,
                      struct error *err)
{
    struct safetensors *st = st_open(s->path, err);
    int rc;

    if (!st)
        return -1;
    rc = params_load_from(ps, st, s->prefix, s->from, err);
    st_close(st);
    return rc;
}

/* ---- joining ----------------------------------------------------------- */

struct joined {
    struct st_tensor *t;
    size_t count, room;
};

/* The tensor in 16 bits, in memory of its own. */
static int checkpoint_convert(struct st_tensor *to,
                              const struct safetensors *st,
                              const struct st_tensor *from, struct error *err)
{
    float *f = malloc((from->count + 1) * sizeof *f);
    uint16_t *h = malloc((from->count + 1) * sizeof *h);
    int rc = f && h ? st_to_f32(st, from, f, err)
                    : error_set(err, EX_OSERR, "out of memory");

    for (size_t i = 0; rc == 0 && i < from->count; i++)
        h[i] = float_to_half(f[i]);
    free(f);
    *to = *from;
    to->dtype = ST_F16;
    to->data = h;
    return rc;
}

/* Append a tensor, or replace the one of its name. */
static int checkpoint_add_tensor(struct joined *j, const struct safetensors *st,
                                 const struct st_tensor *t, struct error *err)
{
    size_t i = 0;

    while (i < j->count && strcmp(j->t[i].name, t->name))
        i++;
    if (i < j->count) {
        free((void *)(uintptr_t)j->t[i].data);
        j->t[i].data = NULL;
    } else if (!list_add(&j->t, &j->count, &j->room, sizeof *j->t, err)) {
        return -1;
    }
    return checkpoint_convert(&j->t[i], st, t, err);
}

int checkpoint_join(const char *path, const char *const *parts, size_t count,
                    const char *spid, struct error *err)
{
    const char *meta[] = {"spid", spid, NULL};
    struct safetensors **open = calloc(count + 1, sizeof *open);
    struct joined j = {0};
    int rc = -1;

    if (!open)
        return error_set(err, EX_OSERR, "out of memory");
    for (size_t k = 0; k < count; k++) {
        open[k] = st_open(parts[k], err);
        if (!open[k])
            goto out;
        for (size_t i = 0; i < st_count(open[k]); i++)
            if (checkpoint_add_tensor(&j, open[k], st_at(open[k], i), err))
                goto out;
    }
    rc = st_save(path, j.t, j.count, spid ? meta : NULL, err);
out:
    for (size_t i = 0; i < j.count; i++)
        free((void *)(uintptr_t)j.t[i].data);
    free(j.t);
    for (size_t k = 0; k < count; k++)
        st_close(open[k]);
    free(open);
    return rc;
}
