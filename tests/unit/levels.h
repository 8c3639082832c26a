/* Running a test once at each level of instructions: the level is decided
 * once in a process, so each gets one of its own. */
#ifndef SPID_TESTS_LEVELS_H
#define SPID_TESTS_LEVELS_H

#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

/* Run test() in a process of its own at each instruction set's level; 1 if
 * one of them failed.  A process that has threads already must not call it. */
__attribute__((unused)) static int at_each_level(int (*test)(void))
{
    static const char *const level[] = {"baseline", "avx2", "avx512"};
    int bad = 0;

    for (int i = 0; i < 3; i++) {
        fflush(stdout);
        pid_t child = fork();
        int status = 1;

        if (child == 0) {
            setenv("SPID_CPU", level[i], 1);
            printf("level %s\n", level[i]);
            int rc = test();

            fflush(stdout);
            _exit(rc);
        }
        if (child < 0 || waitpid(child, &status, 0) < 0 || status)
            bad = 1;
    }
    return bad;
}

#endif
