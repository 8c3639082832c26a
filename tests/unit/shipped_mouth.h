/* The mouth of the shipped head's template avatar, for heads made in a test. */
#ifndef SPID_TESTS_UNIT_SHIPPED_MOUTH_H
#define SPID_TESTS_UNIT_SHIPPED_MOUTH_H

#include <stdio.h>
#include <stdlib.h>

#include "lib/head/head.h"

/* Loaded once; ends the test without it. */
static inline const struct head_avatar *shipped_mouth(void)
{
    static struct head h;
    struct error err = {0};

    if (!h.V && head_load(&h, "examples/model/head.safetensors", &err)) {
        printf("the shipped head: %s\n", err.text);
        exit(1);
    }
    return &h.avatar;
}

#endif
