/* A module that cannot be loaded: the reason is its own, whatever other
 * library was not found before it; what is there later is loaded. */
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "formats/module.h"
#include "tests/check.h"
#include "tests/folder.h"

/* Whether a load fails, after another library's, and says so. */
static bool module_fails(struct error *err, const char *why)
{
    dlopen("libother-people.so", RTLD_LAZY);
    return !module_media(err) && strstr(err->text, why) &&
           !strstr(err->text, "other-people");
}

int main(void)
{
    struct error err = {0};
    FILE *f;

    folder_make();
    setenv("SPID_MODULES", folder, 1);
    check_error("none there", module_fails(&err, ": it is not there (exp"),
                &err);
    f = fopen(folder_at("media.so"), "w");
    fputs("not a library\n", f);
    fclose(f);
    check_error("not a library", module_fails(&err, "media.so: "), &err);
    err = (struct error){0};
    unsetenv("SPID_MODULES");
    check_error("there", module_media(&err), &err);
    folder_remove();
    return check_failures > 0;
}
