/* --head, apart from options.c: programs without networks link this alone. */
#include "cmd/options.h"

int option_head_load(struct head *h, const char *path, struct error *err)
{
    char found[4096];

    if (!path && cli_find_model("head.safetensors", found, sizeof found, err))
        return -1;
    return head_load(h, path ? path : found, err);
}
