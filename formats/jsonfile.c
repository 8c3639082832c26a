/* cJSON's parser on a whole file. */
#include "formats/jsonfile.h"

#include <stdlib.h>
#include <sysexits.h>

#include "lib/base/file.h"

cJSON *jsonfile_read(const char *path, size_t max, struct error *err)
{
    char *text = file_read_text(path, max, err);
    cJSON *j = text ? cJSON_Parse(text) : NULL;

    if (text && !j)
        error_set(err, EX_DATAERR, "%s: cut or damaged (expected JSON)",
                  path);
    free(text);
    return j;
}
