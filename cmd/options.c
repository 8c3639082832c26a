/* Options that several programs have: precision of networks, crop and
 * window. */
#include "cmd/options.h"

#include <string.h>

#include "lib/track/conf.h"
#include "lib/track/track.h"

int option_precision(const char *value, void *dest, struct error *err)
{
    enum nn_type type;

    if (nn_type_parse(&type, value) || type == NN_INT8)
        return error_set(err, EX_USAGE, "unknown precision (expected f32, "
                         "fast or bf16%s)", strcmp(value, "int8") ? ""
                         : "; int8 is for refiners");
    *(enum nn_type *)dest = type;
    return 0;
}

int option_precision_refine(const char *value, void *dest, struct error *err)
{
    if (nn_type_parse(dest, value) == 0)
        return 0;
    return error_set(err, EX_USAGE, "unknown precision (expected f32, fast, "
                     "bf16 or int8)");
}

void option_precision_settle(enum nn_type *type)
{
    if (*type != NN_INT8 || nn_type_native(NN_INT8))
        return;
    warn("no products of 8-bit values on this processor: fast, not int8");
    *type = NN_FAST;
}

int option_crop(const char *value, void *dest, struct error *err)
{
    struct track_options *t = dest;

    t->has_crop = true;
    return square_parse(value, &t->crop, err);
}

int option_window(const char *value, void *dest, struct error *err)
{
    struct track_options *t = dest;

    t->has_window = true;
    return square_parse(value, &t->window, err);
}

int option_words(unsigned *bits, const char *value, const char *const *names,
                 struct error *err)
{
    char known[200] = "";

    for (size_t k = 0, n = 0; names[k] && n < sizeof known; k++)
        n += (size_t)snprintf(known + n, sizeof known - n, "%s%s",
                              k ? ", " : "", names[k]);
    *bits = 0;
    do {
        const size_t n = strcspn(value, ",");
        unsigned k = 0;

        while (names[k] && (strlen(names[k]) != n ||
                            strncmp(value, names[k], n)))
            k++;
        if (!names[k])
            return error_set(err, EX_USAGE, "no such part \"%.*s\" (expected "
                             "%s, or several with commas)", (int)n, value,
                             known);
        *bits |= 1u << k;
        value += n + (value[n] == ',');
    } while (*value);
    return 0;
}
