/* Face, body and pieces joined into one mesh with colours and normals; what
 * covers what. */
#include "lib/lab/people/scan_figure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/vec3.h"
#include "lib/lab/head/surface.h"

/* What grows with corners, or faces. */
static const struct figure_field {
    size_t at, size;            /* of the pointer; bytes of each item */
    bool face;
} fields[] = {
#define FIELD(name, per, face) \
    {offsetof(struct figure, name), \
     (per) * sizeof *((struct figure *)0)->name, face}
    FIELD(place, 3, false), FIELD(normal, 3, false), FIELD(uv, 2, false),
    FIELD(moment, 10, false), FIELD(neck, 1, false), FIELD(extra, 1, false),
    FIELD(bind, 4, false), FIELD(weight, 4, false),
    FIELD(faces, 3, true), FIELD(part, 1, true), FIELD(stuff, 1, true)
};
#define FIELDS (sizeof fields / sizeof *fields)

/* The field gets n more items of 0 behind its first `old`. */
static bool figure_stretch(struct figure *f, const struct figure_field *d,
                           size_t old, size_t n)
{
    char *p;

    memcpy(&p, (char *)f + d->at, sizeof p);
    p = realloc(p, (old + n) * d->size + 1);
    if (!p)
        return false;
    memset(p + old * d->size, 0, n * d->size);
    memcpy((char *)f + d->at, &p, sizeof p);
    return true;
}

struct figure_part *figure_grow(struct figure *f, size_t nc, size_t nf,
                                enum stuff stuff, enum ride ride,
                                uint8_t label, struct error *err)
{
    size_t c = f->nc + nc, n = f->nf + nf;
    bool ok = f->nparts < FIGURE_PARTS;

    for (size_t i = 0; ok && i < FIELDS; i++)
        ok = figure_stretch(f, &fields[i], fields[i].face ? f->nf : f->nc,
                            fields[i].face ? nf : nc);
    if (!ok)
        return error_null(err, EX_OSERR, "out of memory for a person");
    memset(f->part + f->nf, f->nparts, nf);
    memset(f->stuff + f->nf, stuff, nf);
    struct figure_part *p = &f->parts[f->nparts++];
    *p = (struct figure_part){.c0 = f->nc, .c1 = c, .f0 = f->nf, .f1 = n,
                              .stuff = stuff, .ride = ride, .label = label,
                              .tint = {1, 1, 1}};
    f->nc = c;
    f->nf = n;
    if (stuff >= STUFF_VEIL)
        f->nveil += nf;
    return p;
}

/* ---- the scans' own geometry -------------------------------------------- */

/* What face i of the scans is made of; STUFFS: not drawn. */
static enum stuff figure_stuff_of(const struct scan_face *s, size_t i)
{
    int32_t v = s->raw[3 * i];

    switch (s->part[i]) {
    case PART_SKIN: return STUFF_SKIN;
    case PART_SCLERA_LEFT: return STUFF_EYE_LEFT;
    case PART_SCLERA_RIGHT: return STUFF_EYE_RIGHT;
    case PART_TEETH: return STUFF_TEETH;
    case PART_GUM: return STUFF_GUM;
    case PART_LASH: return STUFF_LASH;
    case PART_TEAR: return STUFF_TEAR;
    case PART_BACK:
        return v < FACE_NECK_END ? STUFF_SCALP
               : v < FACE_SOCKET_END ? STUFF_GUM : STUFF_SOCKET;
    default: return STUFFS;
    }
}

static uint8_t figure_label_of(enum stuff s)
{
    static const uint8_t label[STUFFS] = {
        LABEL_SKIN, LABEL_SKIN, LABEL_EYE, LABEL_EYE, LABEL_TEETH,
        LABEL_MOUTH, LABEL_SKIN, LABEL_SKIN, LABEL_CLOTH, LABEL_HAIR,
        LABEL_GLASSES, LABEL_GLASSES, LABEL_OCCLUDER, LABEL_BROW,
        LABEL_BEARD, LABEL_LASH, LABEL_EYE, LABEL_HAIR, LABEL_GLASSES
    };

    return label[s];
}

/* Faces of the scans made of `stuff`, as a part; corners: the first of these
 * parts brings all corners. */
static int figure_add_scans(struct figure *f, enum stuff stuff,
                            struct error *err)
{
    const struct scan_face *s = &f->assets->face;
    bool first = f->nparts == 0;
    size_t n = 0;

    for (size_t i = 0; i < s->nf; i++)
        n += figure_stuff_of(s, i) == stuff;
    struct figure_part *p = figure_grow(f, first ? s->nc : 0, n, stuff,
                                        RIDE_FACE, figure_label_of(stuff), err);
    if (!p)
        return -1;
    n = p->f0;
    for (size_t i = 0; i < s->nf; i++)
        if (figure_stuff_of(s, i) == stuff)
            memcpy(f->faces + 3 * n++, s->faces + 3 * i,
                   3 * sizeof *f->faces);
    for (size_t i = 0; first && i < s->nc; i++) {
        copy3(f->place + 3 * i, f->rest + 3 * s->source[i]);
        f->uv[2 * i] = s->uv[2 * i];
        f->uv[2 * i + 1] = s->uv[2 * i + 1];
        f->bind[4 * i] = s->source[i];
        f->weight[4 * i] = 1;
    }
    return 0;
}

/* ---- what is worn ------------------------------------------------------- */

/* A piece of the assets as a part of the figure, moved to this person's
 * shape. */
static int figure_add_piece(struct figure *f, const struct piece *q,
                            enum stuff stuff, enum ride ride, struct error *err)
{
    struct figure_part *p = figure_grow(f, q->nc, q->nf, stuff, ride,
                                        figure_label_of(stuff), err);
    const float *neutral = f->assets->face.neutral;

    if (!p)
        return -1;
    p->piece = q;
    for (size_t i = 0; i < 3 * q->nf; i++)
        f->faces[3 * p->f0 + i] = q->faces[i] + (int32_t)p->c0;
    memcpy(f->uv + 2 * p->c0, q->uv, 2 * q->nc * sizeof *f->uv);
    memcpy(f->bind + 4 * p->c0, q->bind, 4 * q->nc * sizeof *f->bind);
    memcpy(f->weight + 4 * p->c0, q->weight, 4 * q->nc * sizeof *f->weight);
    for (size_t i = 0; i < q->nc; i++) {
        float *o = f->place + 3 * (p->c0 + i);
        copy3(o, q->place + 3 * i);
        for (size_t k = 0; k < 4; k++) {
            float d[3];
            size_t v = (size_t)q->bind[4 * i + k];
            sub3(d, f->rest + 3 * v, neutral + 3 * v);
            mad3(o, o, d, q->weight[4 * i + k]);
        }
    }
    return 0;
}

/* Hair that would lie under the skin comes out. */
static void figure_lift_hair(struct figure *f, const struct figure_part *p,
                             float gap)
{
    for (size_t i = p->c0; i < p->c1; i++) {
        const float *v = f->rest + 3 * f->bind[4 * i];
        const float *n = f->normal + 3 * f->bind[4 * i];
        float d[3], h;
        sub3(d, f->place + 3 * i, v);
        h = dot3(d, n);
        if (h < gap && length3(d) < 0.08f)
            mad3(f->place + 3 * i, f->place + 3 * i, n, gap - h);
    }
}

/* Faces of which every corner is covered lose their area. */
static void figure_drop_covered(struct figure *f, const struct figure_part *p,
                                const uint8_t *hidden)
{
    for (size_t i = p->f0; hidden && i < p->f1; i++) {
        int32_t *v = f->faces + 3 * i;
        int n = 0;
        for (int k = 0; k < 3; k++)
            n += hidden[p->piece->origin[(size_t)v[k] - p->c0]];
        if (n == 3)
            v[1] = v[2] = v[0];
    }
}

/* Hair above a hat's brim is under it. */
static void figure_drop_under_hat(struct figure *f,
                                  const struct figure_part *hair,
                                  const struct figure_part *hat)
{
    for (size_t i = hair->f0; i < hair->f1; i++) {
        int32_t *v = f->faces + 3 * i;
        const float *p = f->place + 3 * v[0];
        float low = 9, flat = hypotf(p[0], p[2]);
        /* the brim on this side of the head */
        for (size_t c = hat->c0; c < hat->c1; c++) {
            const float *q = f->place + 3 * c;
            if (q[0] * p[0] + q[2] * p[2] > 0.9f * flat * hypotf(q[0], q[2]))
                low = minf(low, q[1]);
        }
        if (p[1] > low + 0.02f)
            v[1] = v[2] = v[0];
    }
}

static void figure_color_piece(struct figure_part *p, const float color[3],
                               bool own)
{
    copy3(p->tint, color);
    p->own = own;
}

/* Torso, clothes, hat. */
static int figure_add_body(struct figure *f, struct error *err)
{
    const struct scan_assets *a = f->assets;
    const struct scan_person *l = &f->look;

    const struct piece *cloth = l->cloth >= 0 ? &a->cloth.piece[l->cloth]
                                              : NULL;

    if (figure_add_piece(f, &a->torso, STUFF_BODY, RIDE_BODY, err))
        return -1;
    if (cloth)
        figure_drop_covered(f, &f->parts[f->nparts - 1], cloth->hidden);
    if (l->cloth >= 0) {
        if (figure_add_piece(f, &a->cloth.piece[l->cloth], STUFF_CLOTH,
                             RIDE_BODY, err))
            return -1;
        figure_color_piece(&f->parts[f->nparts - 1], l->cloth_color,
                           l->cloth_own);
    }
    if (l->hat >= 0) {
        if (figure_add_piece(f, &a->hat.piece[l->hat], STUFF_HAT, RIDE_HEAD,
                             err))
            return -1;
        figure_color_piece(&f->parts[f->nparts - 1], l->cap_color, false);
    }
    return 0;
}

/* The hair of the head, coloured. */
static int figure_add_hair(struct figure *f, struct error *err)
{
    const struct scan_assets *a = f->assets;
    const struct scan_person *l = &f->look;

    if (l->hair >= 0) {
        if (figure_add_piece(f, &a->hair.piece[l->hair], STUFF_HAIR, RIDE_HEAD,
                             err))
            return -1;
        figure_color_piece(&f->parts[f->nparts - 1], l->hair_color, false);
        figure_lift_hair(f, &f->parts[f->nparts - 1], 0.012f);
        for (int i = 0; i < f->nparts - 1; i++)
            if (f->parts[i].stuff == STUFF_HAT)
                figure_drop_under_hat(f, &f->parts[f->nparts - 1],
                                      &f->parts[i]);
    }
    return 0;
}

/* ---- light and carriage ------------------------------------------------- */

/* How far a resting place goes with the shoulders. */
static float figure_neck_share(const struct figure *f, const float *p)
{
    const int32_t *lmk = f->assets->face.landmark;
    const float *chin = f->rest + 3 * lmk[8];
    float back = ramp(chin[2], f->pivot[2], p[2]);
    float top = chin[1] - 0.05f + 0.27f * back;

    return ramp(top, chin[1] - 0.46f, p[1]);
}

/* Directions a corner sees, given what is worn. */
static uint64_t figure_visible_directions(const struct figure *f,
                                          const struct figure_part *p,
                                          size_t corner)
{
    const struct scan_assets *a = f->assets;
    const struct scan_person *l = &f->look;
    uint64_t mask;

    if (p->piece && p->piece->seen && p->ride != RIDE_SKIN) {
        mask = p->piece->seen[corner - p->c0];
    } else {
        size_t v = (size_t)f->bind[4 * corner];
        mask = a->seen[v] & ~a->torso.shade[v];
        if (l->hair >= 0)
            mask &= ~a->hair.piece[l->hair].shade[v];
        if (l->hat >= 0)
            mask &= ~a->hat.piece[l->hat].shade[v];
        if (l->cloth >= 0)
            mask &= ~a->cloth.piece[l->cloth].shade[v];
    }
    return mask;
}

static void figure_find_moments(struct figure *f)
{
    for (int i = 0; i < f->nparts; i++) {
        const struct figure_part *p = &f->parts[i];
        for (size_t c = p->c0; c < p->c1; c++)
            sky_moments(f->moment + 10 * c, figure_visible_directions(f, p, c),
                        f->normal + 3 * c);
    }
}

/* Corner normals at rest.  Hair has those of the head it grows on, mostly:
 * cards face anywhere. */
static int figure_find_normals(struct figure *f, struct error *err)
{
    const struct scan_face *s = &f->assets->face;
    float *n = arena_take(&f->memory, 3 * FACE_VERTICES, sizeof *n);
    float *all = arena_take(&f->memory, 3 * f->nc, sizeof *all);

    if (arena_check(&f->memory, "a person", err))
        return -1;
    surface_normals(n, f->rest, FACE_VERTICES, s->raw, s->nf);
    surface_normals(all, f->place, f->nc, f->faces, f->nf);
    for (int i = 0; i < f->nparts; i++) {
        const struct figure_part *p = &f->parts[i];
        for (size_t c = p->c0; c < p->c1; c++) {
            float *o = f->normal + 3 * c;
            if (p->ride == RIDE_FACE || p->ride == RIDE_SKIN) {
                copy3(o, n + 3 * f->bind[4 * c]);
                continue;
            }
            copy3(o, all + 3 * c);
            if (p->stuff != STUFF_HAIR)
                continue;
            float out[3] = {f->place[3 * c], f->place[3 * c + 1] - 0.15f,
                            f->place[3 * c + 2] - 0.1f};
            unit3(out);
            if (dot3(out, o) < 0)
                mad3(o, (float[3]){0, 0, 0}, o, -1);
            mad3(o, out, o, 0.5f);
            unit3(o);
        }
    }
    return 0;
}

/* Whether a corner sees a place of the sky, head frame. */
static bool figure_sky_is_visible(const struct figure *f, size_t corner,
                                  const float to[3])
{
    uint64_t mask = figure_visible_directions(f, &f->parts[0], corner);
    int best = 0;
    float max = -2;

    for (int k = 0; k < SKY_DIRECTIONS; k++) {
        float d[3];
        sky_direction(d, k);
        if (dot3(d, to) > max) {
            max = dot3(d, to);
            best = k;
        }
    }
    return mask >> best & 1;
}

/* Mean light e (3) on the face as it looks at the camera. */
static void figure_face_light(float e[3], const struct figure *f)
{
    static const float front[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
    struct harmonic2 sky[3];
    float count = 0;

    e[0] = e[1] = e[2] = 0;
    for (int k = 0; k < 3; k++)
        harmonic2_turn(&sky[k], &f->light.sky[k], front);
    for (size_t c = 0; c < f->parts[0].c1; c += 37) {
        if (f->bind[4 * c] >= 6706)     /* narrow face */
            continue;
        for (int k = 0; k < 3; k++)
            e[k] += maxf(harmonic2_moments(&sky[k], f->moment + 10 * c), 0);
        for (int i = 0; i < f->light.nlamp; i++) {
            float d[3], nl;
            rot3(d, front, f->light.lamp[i].dir);
            nl = dot3(d, f->normal + 3 * c);
            if (nl > 0 && figure_sky_is_visible(f, c, d))
                mad3(e, e, f->light.lamp[i].rgb, 0.318f * nl);
        }
        count += 1;
    }
    for (int k = 0; k < 3; k++)
        e[k] = maxf(e[k] / count, 0.02f);
}

/* What exposure and white balance suit the light on the face. */
static void figure_expose(struct figure *f)
{
    float e[3], lum, white[3];
    const struct scan_camera *c = &f->look.camera;

    light_init(&f->light, &f->assets->light[f->look.light], f->look.turn,
               f->look.gain);
    figure_face_light(e, f);
    lum = 0.3f * e[0] + 0.59f * e[1] + 0.11f * e[2];
    /* the camera evens out most of the light's colour */
    for (int k = 0; k < 3; k++)
        white[k] = clampf(powf(lum / e[k], 0.85f), 0.6f, 1.8f);
    for (int k = 0; k < 3; k++)
        f->look.gain[k] = white[k] * c->balance[k];
    light_init(&f->light, &f->assets->light[f->look.light], f->look.turn,
               f->look.gain);
    float tone = 0.3f * f->tone[0] + 0.59f * f->tone[1] + 0.11f * f->tone[2];
    /* dark skin stays darker than fair skin in a picture */
    f->exposure = c->exposure * 0.40f / (lum * powf(tone, 0.5f));
}

/* Normals, eyes, lips and the neck's pivot of the face at rest. */
static void figure_measure(struct figure *f)
{
    const struct scan_face *s = &f->assets->face;

    surface_normals(f->normal, f->rest, FACE_VERTICES, s->raw, s->nf);
    for (int e = 0; e < 2; e++) {
        double shift[3], grow;
        scan_eye_motion(shift, &grow, s->neutral, f->rest, 5, e);
        for (int k = 0; k < 3; k++)
            f->eye[e][k] = s->eye[e][k] + (float)shift[k];
    }
    const float *u = f->rest + 3 * s->landmark[62];
    lerp3(f->lip, u, f->rest + 3 * s->landmark[66], 0.5f);
    const float *chin = f->rest + 3 * s->landmark[8];
    f->pivot[0] = 0;
    f->pivot[1] = chin[1] - 0.06f;
    f->pivot[2] = chin[2] - 0.55f;
}

int figure_init(struct figure *f, const struct scan_assets *a,
                const struct scan_person *p, struct error *err)
{
    static const enum stuff solid[] = {
        STUFF_SKIN, STUFF_SCALP, STUFF_EYE_LEFT, STUFF_EYE_RIGHT,
        STUFF_TEETH, STUFF_GUM, STUFF_SOCKET
    };
    int rc = 0;

    *f = (struct figure){.look = *p, .assets = a};
    f->rest = arena_take(&f->memory, 3 * FACE_VERTICES, sizeof *f->rest);
    f->skin = arena_take(&f->memory, SKIN_SIZE * SKIN_SIZE, 4);
    f->brow = arena_take(&f->memory, BROW_PLANE, 2);
    if (arena_check(&f->memory, "a person", err))
        return -1;
    scan_face_fold(f->rest, &a->face, p->beta, SCAN_IDENTITIES);
    skin_paint(f->skin, f->tone, &a->skin, &p->skin, &a->traits);
    brow_paint(f->brow, &a->skin.brows, p->brow);
    for (int i = 0; !rc && i < 7; i++) {
        rc = figure_add_scans(f, solid[i], err);
        if (i == 0 && !rc)
            figure_measure(f);
    }
    rc = rc || figure_add_body(f, err) || figure_add_solids(f, err) ||
         figure_add_front(f, err) || figure_add_hair(f, err) ||
         figure_add_veils(f, err) || figure_add_scans(f, STUFF_LASH, err) ||
         figure_add_scans(f, STUFF_TEAR, err) || figure_find_normals(f, err);
    if (rc)
        return -1;
    for (int i = 0; i < f->nparts; i++)
        for (size_t c = f->parts[i].c0; c < f->parts[i].c1; c++)
            f->neck[c] = f->parts[i].ride == RIDE_BODY
                         ? 1 : figure_neck_share(f, f->place + 3 * c);
    figure_find_moments(f);
    figure_expose(f);
    return 0;
}

void figure_release(struct figure *f)
{
    for (size_t i = 0; i < FIELDS; i++) {
        void *p;

        memcpy(&p, (char *)f + fields[i].at, sizeof p);
        free(p);
    }
    arena_release(&f->memory);
    *f = (struct figure){0};
}
