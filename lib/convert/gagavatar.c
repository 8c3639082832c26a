/* GAGAvatar's checkpoint: the names stay; every tensor that its networks have
 * here must be there in its shape. */
#include "lib/gagavatar/gagavatar.h"
#include "lib/convert/table.h"

int convert_gagavatar(struct convert *c, const struct convert_options *o,
                      struct error *err)
{
    const size_t any[2] = {0, 256};
    char prefix[TENSORFILE_NAME];
    struct gagavatar g;
    struct params ps;
    size_t i;
    int rc = -1;

    (void)o;
    convert_prefix(prefix, c, 0, "head_base");
    i = convert_find(c, 0, prefix, "head_base", 2, any, false);
    params_init(&ps);
    if (!gagavatar_init(&g, &ps, i == SIZE_MAX ? 5023
                        : tensorfile_at(c->file[0], i)->dim[0], err)) {
        convert_set_meta(c, "spid", "{\"version\":1,\"type\":\"gagavatar\"}");
        rc = convert_take_params(c, 0, prefix, &ps, "", "", err);
        gagavatar_release(&g);
    }
    params_release(&ps);
    return rc;
}
