/* A head's template avatar made, and written into its file. */
#include "lib/lab/head/avatar_make.h"

#include <stdbool.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/lab/head/headfile.h"

/* How people wear hair and cloth, for a head of the same mesh; else all hair is on
 * its scalp, flat, and no cloth on its neck. */
static void avatar_copy_styles(struct head_avatar *to, const struct head *h,
                               const struct head_avatar *from)
{
    const size_t n = HEAD_STYLES * to->V;
    const bool same = from->V == to->V;

    memcpy(to->hair_share, from->hair_share, HEAD_STYLES * sizeof(float));
    memcpy(to->cloth_share, from->cloth_share, HEAD_STYLES * sizeof(float));
    for (size_t i = 0; i < n; i++) {
        to->hair[i] = same ? from->hair[i]
                      : h->hair ? h->hair[i / HEAD_STYLES] : 0;
        to->relief[i] = same ? from->relief[i] : 0;
        to->cloth[i] = same ? from->cloth[i] : 0;
    }
}

/* The mouth's arrays: a mouth is anybody's. */
static void avatar_copy_mouth(struct head_avatar *to,
                              const struct head_avatar *from)
{
    const size_t cells = from->mouth * from->mouth;

    memcpy(to->mouth_place, from->mouth_place, 3 * cells * sizeof(float));
    memcpy(to->mouth_size, from->mouth_size, 3 * cells * sizeof(float));
    memcpy(to->mouth_turn, from->mouth_turn, 4 * cells * sizeof(float));
    memcpy(to->mouth_color, from->mouth_color, 3 * cells * sizeof(float));
    memcpy(to->mouth_jaw, from->mouth_jaw, cells * sizeof(float));
    memcpy(to->mouth_layer, from->mouth_layer, cells * sizeof(float));
}

int avatar_make(struct head *h, const struct head_avatar *from,
                struct error *err)
{
    struct densify d;
    int rc;

    head_avatar_release(&h->avatar);
    if (densify_init(&d, h->f, h->F, h->V, err))
        return -1;
    rc = head_avatar_init(&h->avatar, h->V, h->V + d.E, from->mouth, err) ||
         avatar_points_make(&h->avatar, h, &d, err) ? -1 : 0;
    if (rc == 0) {
        avatar_eyes_make(&h->avatar, h, &d);
        avatar_copy_mouth(&h->avatar, from);
        avatar_copy_styles(&h->avatar, h, from);
    }
    densify_release(&d);
    return rc;
}

/* Halves, but for a few numbers that go on to be floats. */
static int avatar_file_array(struct headfile *f, const char *name,
                             const float *x, size_t count, size_t width,
                             struct error *err)
{
    const bool few = count < 16;
    void *made = headfile_add(f, name, few ? ST_F32 : ST_F16, count / width,
                              width > 1 ? width : 0, 0, err);
    uint16_t *half = made;

    if (!made)
        return -1;
    if (few)
        memcpy(made, x, count * sizeof *x);
    else
        for (size_t i = 0; i < count; i++)
            half[i] = float_to_half(x[i]);
    return 0;
}

static int avatar_file_add(struct headfile *f, const struct head_avatar *a,
                           struct error *err)
{
    int32_t *mirror = headfile_add(f, "avatar.mirror", ST_I32, a->points, 0, 0,
                                   err);
    size_t count, width;
    const char *name;
    const float *x;
    int rc = mirror ? 0 : -1;

    for (size_t k = 0; rc == 0 && k < a->points; k++)
        mirror[k] = (int32_t)a->mirror[k];
    for (size_t i = 0; rc == 0 &&
                       (x = head_avatar_array(a, i, &name, &count, &width)); i++)
        rc = avatar_file_array(f, name, x, count, width, err);
    return rc;
}

/* The file anew, with the template avatar a or, NULL, none. */
static int avatar_file_write(const char *path, const struct head_avatar *a,
                             struct error *err)
{
    struct headfile f;

    if (headfile_open(&f, path, err))
        return -1;
    const int rc = (a && avatar_file_add(&f, a, err)) ||
                   headfile_save(&f, path, err) ? -1 : 0;

    headfile_close(&f);
    return rc;
}

/* What avatar the file has may be an older one, which nobody reads. */
int avatar_make_file(const char *path, const char *mouth, struct error *err)
{
    struct head h = {0}, from;
    int rc = -1;

    if (head_load(&from, mouth, err))
        return -1;
    if (!from.avatar.mouth)
        error_set(err, EX_DATAERR, "%s: no template avatar (expected one, for "
                  "its mouth)", mouth);
    else if (avatar_file_write(path, NULL, err) == 0 &&
             head_load(&h, path, err) == 0 &&
             avatar_make(&h, &from.avatar, err) == 0)
        rc = avatar_file_write(path, &h.avatar, err);
    head_release(&h);
    head_release(&from);
    return rc;
}
