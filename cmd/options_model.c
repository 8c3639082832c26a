/* Apart from options.c: programs without networks link no safetensors. */
#include "cmd/options.h"

#include "lib/model/model.h"

int option_model_open(struct model *m, struct error *err)
{
    char path[4096];

    return cli_find_model("model.safetensors", path, sizeof path, err) ||
                   model_open(m, path, err)
               ? -1
               : 0;
}
