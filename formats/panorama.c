/* Panoramas (panorama.h), by the module for pictures: a file of its own, for
 * programs that read no others. */
#include "formats/panorama.h"

#include <stdlib.h>
#include <string.h>

#include "formats/module.h"

int panorama_read(struct panorama *p, const char *path, struct error *err)
{
    const struct media_module *m = module_media(err);

    memset(p, 0, sizeof *p);
    return m ? m->panorama_read(p, path, err) : error_prefix(err, "%s", path);
}

void panorama_release(struct panorama *p)
{
    free(p->rgb);
    memset(p, 0, sizeof *p);
}
