/* Where a program finds its model and head: the search order of spid(1). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cmd/cli.h"
#include "lib/base/file.h"

/* One search: the file's name, where its path goes, and what was tried. */
struct search {
    const char *name;          /* "head.safetensors" */
    char *path;
    size_t size;               /* of path */
    char tried[400];           /* paths that did not open, for the message */
};

/* Does dir/name open, or dir itself when it is the file (whole)? */
static bool cli_search_try(struct search *s, const char *dir, bool whole)
{
    size_t used = strlen(s->tried);

    snprintf(s->path, s->size, "%s%s%s", dir, whole ? "" : "/",
             whole ? "" : s->name);
    if (access(s->path, R_OK) == 0)
        return true;
    snprintf(s->tried + used, sizeof s->tried - used, "%s%s",
             used ? ", " : "", s->path);
    return false;
}

/* -m or $SPID_MODEL names the model file itself, whose directory then holds
 * the others, or a directory. */
static bool cli_search_given(struct search *s, const char *given)
{
    char dir[512];
    char *slash;

    if (cli_search_try(s, given, false))
        return true;
    if (!file_ends(given, ".safetensors"))
        return false;
    if (strcmp(s->name, "model.safetensors") == 0)
        return cli_search_try(s, given, true);
    snprintf(dir, sizeof dir, "%s", given);
    slash = strrchr(dir, '/');
    if (slash)
        *slash = '\0';
    return cli_search_try(s, slash ? dir : ".", false);
}

/* Directory of the running binary plus suffix, for an uninstalled tree. */
static bool cli_search_beside(struct search *s, const char *suffix)
{
    char own[400], dir[512];

    if (!file_own_folder(own, sizeof own))
        return false;
    snprintf(dir, sizeof dir, "%s%s", own, suffix);
    return cli_search_try(s, dir, false);
}

int cli_find_model(const char *name, char *path, size_t size,
                   struct error *err)
{
    struct search s = { .name = name, .path = path, .size = size };
    const char *env = getenv("SPID_MODEL");
    const char *data = getenv("XDG_DATA_HOME");
    const char *home = getenv("HOME");
    char dir[300];

    if (cli.model && cli_search_given(&s, cli.model))
        return 0;
    /* A model asked for by name is not quietly replaced by another; only the
     * files that go with every model are still looked for. */
    if (cli.model && strcmp(name, "model.safetensors") == 0)
        goto fail;
    if (env && cli_search_given(&s, env))
        return 0;
    if (data && *data)
        snprintf(dir, sizeof dir, "%s/spid", data);
    else
        snprintf(dir, sizeof dir, "%s/.local/share/spid", home ? home : "");
    if (cli_search_try(&s, dir, false) ||
        cli_search_try(&s, SPID_DATADIR, false) ||
        cli_search_beside(&s, "../share/spid") ||
        cli_search_beside(&s, "../../examples/model"))
        return 0;
fail:
    return error_set(err, EX_NOINPUT, "%s not found (tried %s)", name,
                     s.tried);
}
