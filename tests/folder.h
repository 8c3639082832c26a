/* A folder for one test's files, gone when the test has ended. */
#ifndef SPID_TESTS_FOLDER_H
#define SPID_TESTS_FOLDER_H

#include <stdio.h>
#include <stdlib.h>

static char folder[] = "/tmp/spid-test-XXXXXX";

/* Make it; without one the test is skipped (exit 77). */
static inline void folder_make(void)
{
    if (!mkdtemp(folder)) {
        printf("no temporary folder\n");
        exit(77);
    }
}

/* Path of a file in it, valid until the fourth call after this one. */
static inline const char *folder_at(const char *name)
{
    static char path[4][256];
    static int turn;

    turn = (turn + 1) % 4;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

/* Remove it and what it holds.  Not 0 when it stays. */
static inline int folder_remove(void)
{
    char command[80];

    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

#endif
