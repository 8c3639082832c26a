/* -m, apart from options.c: programs without networks do not link
 * this. */
#include "cmd/options.h"

#include "lib/net/model.h"

int option_model_open(struct model *m, struct error *err)
{
    char path[4096];

    return cli_find_model("model.safetensors", path, sizeof path, err) ||
                   model_open(m, path, err)
               ? -1
               : 0;
}
