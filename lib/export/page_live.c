/* A page's tracker: its network and its landmarks, packed. */
#include "lib/export/page_live.h"

#include <stdlib.h>

#include "lib/track/landmarks.h"

/* A network's file as bytes. */
static int page_pack_network(struct pack *k, const char *name,
                             const struct networks *nets, enum network which,
                             struct error *err)
{
    struct graph g;
    size_t bytes = 0;
    uint8_t *packed = networks_graph(&g, nets, which, err)
                          ? NULL
                          : onnx_pack(&bytes, &g.file, err);

    graph_release(&g);
    if (!packed)
        return -1;
    page_pack_add(k, name, ST_U8, bytes, 0, packed);
    free(packed);
    return 0;
}

int page_pack_live(struct pack *k, const struct networks *nets,
                   const struct head *head, struct error *err)
{
    struct identity mean = {0};
    struct landmarks l = {0};
    int rc = head_fold(&mean, head, NULL, 0, err) ||
             landmarks_init(&l, &mean, err) ||
             page_pack_network(k, "net.motion", nets, NETWORK_MOTION, err)
                 ? -1 : 0;

    if (rc == 0) {
        page_pack_head(k, "track.", &l.id);
        page_pack_add(k, "track.corner", ST_I32, HEAD_LANDMARKS, 3, l.corner);
        page_pack_add(k, "track.bary", ST_F32, HEAD_LANDMARKS, 3, l.bary);
    }
    landmarks_release(&l);
    identity_release(&mean);
    return rc;
}
