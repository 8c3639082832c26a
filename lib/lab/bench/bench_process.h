/* Programs of the toolkit run as children, for what a process costs. */
#ifndef SPID_LAB_BENCH_BENCH_PROCESS_H
#define SPID_LAB_BENCH_BENCH_PROCESS_H

#include "lib/base/error.h"

#define PROCESS_PATH 4096

/* The program of that name beside the one that runs: path (PROCESS_PATH).
 * EX_NOINPUT when it is not there. */
int process_find(char *path, const char *name, struct error *err);

/* What a child used.  (Of memory it counts what this process holds when it
 * starts it: let that be little.) */
struct process_cost {
    double seconds;             /* of processors, all threads */
    double peak;                /* memory, MB */
};

/* Run args (NULL ended) to its end, standard input from fd `in` (-1: as it
 * is).  EX_SOFTWARE, naming the program, when its status is not 0.  cost NULL
 * is allowed. */
int process_run(const char *const *args, int in, struct process_cost *cost,
                struct error *err);

/* The same begun and ended apart, for a child that is fed meanwhile.  begin:
 * its id, or -1. */
int process_begin(const char *const *args, int in, struct error *err);
/* The child's end; name: for the message. */
int process_end(int child, const char *name, struct process_cost *cost,
                struct error *err);

#endif
