/* The paper's ablations as words of an option. */
#include "lib/avatar/ablation.h"

#include <stdio.h>
#include <string.h>
#include <sysexits.h>

unsigned avatar_without_parse(const char *word)
{
    static const char *const words[] = {"dynamic", "static", "mouth",
                                        "interp", "deform", "neck"};

    if (strcmp(word, "bend") == 0)
        return WITHOUT_NECK;
    for (unsigned i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(word, words[i]) == 0)
            return 1u << i;
    return 0;
}

int avatar_without_list(unsigned *bits, const char *words, struct error *err)
{
    while (*words) {
        size_t n = strcspn(words, ",");
        char word[16];

        snprintf(word, sizeof word, "%.*s", (int)(n < 15 ? n : 15), words);
        unsigned bit = avatar_without_parse(word);
        if (!bit)
            return error_set(err, EX_USAGE, "unknown part \"%s\" (expected "
                             "dynamic, static, mouth, interp, deform or "
                             "neck)", word);
        *bits |= bit;
        words += n + (words[n] == ',');
    }
    return 0;
}
