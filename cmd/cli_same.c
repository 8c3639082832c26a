/* What is written is not what is read: checked before anything is opened. */
#include <string.h>

#include "cmd/cli_parts.h"
#include "lib/base/file.h"

/* The name of a file that cannot be both, on the command line. */
struct named {
    const char *option;         /* NULL: an operand */
    const char *value;
    bool written;
};

static struct named names[CLI_NAMES];
static size_t count;

void cli_name_file(const char *option, const char *value, bool written)
{
    if (count < CLI_NAMES)
        names[count++] = (struct named){option, value, written};
}

/* Each that is written against each other. */
void cli_check_files(void)
{
    for (size_t i = 0; i < count; i++) {
        if (names[i].written && !names[i].value[0])
            die(EX_USAGE, "--%s=: no name (expected a file's)",
                names[i].option);
        for (size_t k = 0; k < count; k++) {
            const struct named *out = &names[i], *in = &names[k];

            if (i == k || !out->written || !file_is_same(out->value, in->value))
                continue;
            die(EX_USAGE, "--%s=%s: the same file as %s%s%s (expected another, "
                "so that nothing is lost)", out->option, out->value,
                in->option ? "--" : "", in->option ? in->option : "",
                in->option ? "" : in->value);
        }
    }
}
