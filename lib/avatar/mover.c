/* Phase B of the branches on a stream: MESH records in, GAUS once and GMOV
 * out. */
#include "lib/avatar/mover.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/branch.h"
#include "lib/stream/records.h"
#include "lib/head/mesh.h"
#include "lib/head/person.h"

/* The head's hash of a CONF record; hash stays when it names none. */
static void mover_read_hash(char hash[17], const struct record *rec)
{
    struct person p = {0};

    if (person_read_record(&p, rec, 0, NULL) == 1)
        memcpy(hash, p.head, 17);
}

/* Leave out branches and midpoints of an avatar that was baked with them. */
static int mover_drop_branches(struct baked *b, unsigned without, size_t V,
                               struct error *err)
{
    uint8_t *keep = malloc(b->N + 1);

    if (!keep)
        return error_set(err, EX_OSERR, "no memory for %zu Gaussians", b->N);
    for (size_t i = 0; i < b->N; i++)
        keep[i] = !(without >> b->branch[i] & 1) &&
                  !(without & WITHOUT_INTERP && i < b->dynamic &&
                    (size_t)b->vertex[i] >= V);
    baked_keep(b, keep);
    if (without & WITHOUT_NECK)
        baked_drop_neck(b);
    free(keep);
    return 0;
}

/* Up to the first GAUS record; the rest of the file is not read. */
static int mover_take(const struct record *rec, void *mover, struct error *err)
{
    struct mover *m = mover;

    if (record_is(rec, RECORD_CONF))
        mover_read_hash(m->head, rec);
    if (record_is(rec, RECORD_SRCI))
        return person_read_record(&m->person, rec, 0, err) < 0 ? -1 : 0;
    if (!record_is(rec, RECORD_GAUS))
        return 0;
    return baked_read(&m->baked, rec, 0, err) ? -1 : 1;
}

int mover_open(struct mover *m, const char *path,
               const struct mover_options *opt, struct error *err)
{
    *m = (struct mover){.opt = *opt, .path = path};
    const int rc = stream_load(path, mover_take, m, err);

    if (rc == 0)
        error_set(err, EX_DATAERR, "%s: no GAUS record (expected an avatar, as "
                  "spid-branches --bake writes it)", path);
    return rc > 0 ? 0 : -1;
}

void mover_release(struct mover *m)
{
    person_release(&m->person);
    baked_release(&m->baked);
    densify_release(&m->dense);
    baked_move_release(&m->move);
    free(m->means);
    memset(m, 0, sizeof *m);
}

/* The first mesh brings the faces: edges, and whether it fits the avatar. */
static int mover_first_mesh(struct mover *m, const struct mesh *mesh,
                            struct error *err)
{
    const size_t V = mesh->V;

    if (!mesh->faces)
        return error_set(err, EX_DATAERR, "MESH has no array 'faces' (expected "
                         "i32[F,3] in the first one)");
    if (target_light_apply(&m->baked, &m->opt.light, &m->driver, err) ||
        densify_init(&m->dense, mesh->faces, mesh->F, V, err) ||
        mover_drop_branches(&m->baked, m->opt.without, V, err))
        return -1;
    for (size_t i = 0; i < m->baked.dynamic; i++)
        if ((size_t)m->baked.vertex[i] >= V + m->dense.E)
            return error_set(err, EX_DATAERR, "MESH has %zu vertices and %zu "
                             "edges (expected more than %d: the avatar "
                             "belongs to another head)", V, m->dense.E,
                             m->baked.vertex[i]);
    m->means = malloc((3 * m->baked.N + 1) * sizeof(float));
    if (!m->means)
        return error_set(err, EX_OSERR, "no memory for %zu Gaussians",
                         m->baked.N);
    return baked_move_init(&m->move, &m->baked, err);
}

/* The whole set (--full), or the set once and then what moved. */
static int mover_write(struct stream_writer *out, struct mover *m,
                       const struct record *rec, const float *cam,
                       struct error *err)
{
    static const int32_t first = 0;
    const struct gmov moved = {
        .cam = cam, .first = m->move.mean ? &first : NULL,
        .mean = m->move.mean, .count = m->baked.dynamic,
        .shift = m->move.frame.to,
        .chin = m->baked.has_jaw ? m->move.frame.chin : NULL,
        .body = m->baked.blended ? m->move.frame.plane : NULL
    };
    struct array a[STREAM_MAX_ARRAYS];

    /* places are of no use without the photograph */
    if (!m->sent && m->person.back && baked_has_places(&m->baked) &&
        person_write_picture(out, &m->person, err))
        return -1;
    if (m->opt.full) {
        m->sent = true;
        baked_means(m->means, &m->baked, &m->move);
        return baked_write(out, rec->frame, rec->time, &m->baked, m->means,
                           cam, err);
    }
    if (!m->sent && baked_write(out, rec->frame, rec->time, &m->baked, NULL,
                                NULL, err))
        return -1;
    m->sent = true;
    int n = gmov_arrays(a, &moved);
    n += record_others(a + n, n, rec, mesh_arrays);
    return stream_write(out, RECORD_GMOV, rec->frame, rec->time, a, n, err);
}

/* mu_D = densified V_d, the mouth's shift, the camera T_d. */
static int mover_frame(struct stream_writer *out, struct mover *m,
                       const struct record *rec, struct error *err)
{
    struct mesh mesh;

    if (mesh_read(&mesh, rec, err) ||
        (!m->means && mover_first_mesh(m, &mesh, err)))
        return -1;
    if (mesh.V != m->dense.V)
        return error_set(err, EX_DATAERR, "MESH has %zu vertices (expected "
                         "%zu, as the first one)", mesh.V, m->dense.V);
    /* an unknown opening counts as open */
    baked_drive(&m->move, &m->baked, &m->dense, mesh.verts, mesh.lip,
                mesh.chin, mesh.gap ? *mesh.gap : 1, mesh.cam);
    return mover_write(out, m, rec, mesh.cam, err);
}

/* The stream's head against the avatar's, where both are named. */
static int mover_check_head(const struct mover *m, const struct record *rec,
                            struct error *err)
{
    char hash[17] = "";

    mover_read_hash(hash, rec);
    if (hash[0] && m->head[0] && strcmp(hash, m->head))
        return error_set(err, EX_DATAERR, "%s: avatar belongs to head %s "
                         "(expected %s, the stream's)", m->path, m->head,
                         hash);
    return 0;
}

int mover_apply(struct mover *m, struct stream_writer *out,
                const struct record *rec, struct error *err)
{
    if (record_is(rec, RECORD_MESH))
        return mover_frame(out, m, rec, err);
    if ((record_is(rec, RECORD_CONF) && mover_check_head(m, rec, err)) ||
        (m->opt.light.from == LIGHT_DRIVER && !m->driver.lit &&
         record_is(rec, RECORD_MOTN) && motion_read(&m->driver, rec, 0, err)))
        return -1;
    return stream_copy(out, rec, err);
}
