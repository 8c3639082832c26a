/* The processors that this process may use: how many, and which its threads
 * leave to each other. */
#ifndef SPID_BASE_PROCESSORS_H
#define SPID_BASE_PROCESSORS_H

#include <pthread.h>

/* Those of its affinity mask (taskset, cpusets of containers and batch systems;
 * not all that are online), or fewer where a control group's quota of processor
 * time is less, rounded up.  At least 1. */
int processors_allowed(void);

/* The least quota of the process's control group and those above it, in
 * processors, after /proc/self/cgroup, cpu.max (version 2), cpu.cfs_quota_us
 * and cpu.cfs_period_us (version 1) under the folder root ("" is the real
 * one); 0 where none is set. */
double processors_quota(const char *root);

/* Keep one of this process's threads off the processors taken[0] to
 * taken[count - 1] (negative: none) of others that work at once, until they wait;
 * unless no other would be left of the mask that the process began with: then, as
 * with none taken, it may be on all.  Where another program keeps a processor busy,
 * the system leaves two of ours together on the next: to it that is no worse than
 * one of them beside that program.  At a lower priority it is better: beside that
 * program a thread hardly runs, so a nice process keeps off none. */
void processors_avoid(pthread_t thread, const int *taken, int count);

#endif
