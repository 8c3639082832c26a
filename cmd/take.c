/* A take of Live Link Face becomes a motion stream. */
#include "cmd/take.h"

#include <sysexits.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "lib/head/person.h"
#include "lib/track/take.h"
#include "lib/track/conf.h"
#include "lib/track/relative.h"

int take_check_head(const struct head *h, struct error *err)
{
    if (head_has_arkit(h))
        return 0;
    return error_set(err, EX_CONFIG, "--arkit: the head has not ARKit's "
                     "expressions (expected one of spid-head --from, such as "
                     "the one that comes with the model)");
}

/* The take at rest, added to whose own motion r makes of it. */
static int take_relative(struct relative *r, const char *path, size_t nexp,
                         struct error *err)
{
    static const float rest[LIVELINK_CHANNELS];
    struct person source = {0};
    struct motion neutral;

    if (person_load(&source, path, nexp, err))
        return -1;
    take_to_motion(&neutral, nexp, rest);
    relative_init(r, &source.calm, &neutral, nexp);
    if (!source.has_source)
        error_set(err, EX_DATAERR, "--relative=%s: no MOTN record (expected "
                  "an identity, as spid-shape writes it)", path);
    person_release(&source);
    return err->code ? -1 : 0;
}

/* MOTN of one frame. */
static int take_put(struct stream_writer *out, uint64_t frame,
                    const struct livelink_frame *f, size_t nexp,
                    const struct relative *r, struct error *err)
{
    const struct array lost = motion_lost();
    struct motion m;

    take_to_motion(&m, nexp, f->value);
    if (r)
        relative_apply(&m, r);
    return motion_write(out, frame, f->time, &m, nexp, &lost, f->held, err);
}

/* All frames. */
static int take_copy(struct stream_writer *out, struct livelink *in,
                     const char *name, size_t nexp,
                     const struct relative *r, struct error *err)
{
    struct livelink_frame f;
    uint64_t frame = 0;
    size_t held = 0;
    int rc;

    while ((rc = livelink_read(in, &f, err)) > 0) {
        if (take_put(out, frame++, &f, nexp, r, err))
            return -1;
        held += f.held;
        progress("frames", frame, 0, f.held ? "held" : NULL);
    }
    progress_end();
    if (held)
        warn("%s: no face or no row in %zu of %llu frames: the last motion "
             "is held", name, held, (unsigned long long)frame);
    return rc;
}

void take_warn(const struct livelink *in, const char *name)
{
    size_t count;
    const char *unknown = livelink_unknown(in, &count);

    if (unknown)
        warn("%s: %zu column%s not used: %s%s", name, count,
             plural(count), unknown, count > 4 ? ", ..." : "");
    if (livelink_repeated(in))
        warn("%s: %zu row%s left out for timecodes that were there already",
             name, livelink_repeated(in), plural(livelink_repeated(in)));
}

int take_pack(struct stream_writer *out, const char *path, double rate,
              const char *head_path, const char *identity,
              struct error *err)
{
    struct head head;
    struct relative relative;
    struct livelink *in = NULL;
    int rc = -1;

    if (option_head_load(&head, head_path, err))
        return -1;
    struct conf conf = {.producer = "spid-pack", .head = &head,
                        .fps_den = 1};
    if (take_check_head(&head, err) == 0 &&
        (!identity || take_relative(&relative, identity, head.nexp,
                                    err) == 0) &&
        (in = livelink_open(path, rate, err))) {
        conf.fps_num = (int)(livelink_rate(in) + 0.5);
        rc = conf_write(out, &conf, err) ||
             take_copy(out, in, path, head.nexp,
                       identity ? &relative : NULL, err) ? -1 : 0;
        take_warn(in, path);
    }
    livelink_close(in);
    head_release(&head);
    return rc;
}
