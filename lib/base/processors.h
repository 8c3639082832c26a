/* How many processors this process may use. */
#ifndef SPID_BASE_PROCESSORS_H
#define SPID_BASE_PROCESSORS_H

/* Those of its affinity mask (taskset, cpusets of containers and batch systems;
 * not all that are online), or fewer where a control group's quota of processor
 * time is less, rounded up.  At least 1. */
int processors_allowed(void);

/* The least quota of the process's control group and those above it, in
 * processors, after /proc/self/cgroup, cpu.max (version 2), cpu.cfs_quota_us
 * and cpu.cfs_period_us (version 1) under the folder root ("" is the real
 * one); 0 where none is set. */
double processors_quota(const char *root);

#endif
