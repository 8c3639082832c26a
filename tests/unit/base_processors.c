/* Quotas of control groups, read from a made /proc and /sys: version 2 and 1,
 * the least of a group and those above it, none set; and a thread that keeps off
 * processors. */
#include "lib/base/processors.h"

#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include "tests/check.h"

static char root[] = "/tmp/processors-XXXXXX";

/* The file at path under root, with its folders. */
static void processors_put(const char *path, const char *text)
{
    char command[512];

    snprintf(command, sizeof command,
             "mkdir -p $(dirname %s%s) && printf '%%b' '%s' > %s%s", root, path,
             text, root, path);
    CHECK(system(command) == 0, "cannot write %s", path);
}

/* Off the processor it is on, off none, off all of them, and when the process is nice. */
static void processors_keep_off(void)
{
    const int here = sched_getcpu(), taken[] = {-1, here};
    int every[CPU_SETSIZE];
    cpu_set_t mask;

    sched_getaffinity(0, sizeof mask, &mask);
    const int all = CPU_COUNT(&mask);
    if (all < 2 || getpriority(PRIO_PROCESS, 0) > 0)
        return;
    processors_avoid(pthread_self(), taken, 2);
    sched_getaffinity(0, sizeof mask, &mask);
    check_that("not on the one that is taken",
               !CPU_ISSET(here, &mask) && sched_getcpu() != here);
    expect("on all others", CPU_COUNT(&mask), all - 1, 0);
    processors_avoid(pthread_self(), taken, 1);
    sched_getaffinity(0, sizeof mask, &mask);
    expect("none is taken", CPU_COUNT(&mask), all, 0);
    for (int i = 0; i < CPU_SETSIZE; i++)
        every[i] = i;
    processors_avoid(pthread_self(), every, CPU_SETSIZE);
    sched_getaffinity(0, sizeof mask, &mask);
    expect("all are taken", CPU_COUNT(&mask), all, 0);
    check_that("nice", nice(1) != -1);
    processors_avoid(pthread_self(), taken, 2);
    sched_getaffinity(0, sizeof mask, &mask);
    expect("nice: on all", CPU_COUNT(&mask), all, 0);
}

int main(void)
{
    CHECK(mkdtemp(root) != NULL, "no folder %s", root);
    expect("nothing there", processors_quota(root), 0, 1e-12);
    processors_put("/proc/self/cgroup", "0::/a/b\\n");
    processors_put("/sys/fs/cgroup/a/b/cpu.max", "max 100000\\n");
    expect("no limit", processors_quota(root), 0, 1e-12);
    processors_put("/sys/fs/cgroup/a/cpu.max", "150000 100000\\n");
    expect("of the group above", processors_quota(root), 1.5, 1e-12);
    processors_put("/sys/fs/cgroup/a/b/cpu.max", "25000 50000\\n");
    expect("of the group itself", processors_quota(root), 0.5, 1e-12);
    processors_put("/proc/self/cgroup", "5:memory:/\\n4:cpu,cpuacct:/x/y\\n");
    expect("version 1 without a quota", processors_quota(root), 0, 1e-12);
    processors_put("/sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "300000\\n");
    processors_put("/sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us",
                   "100000\\n");
    expect("version 1, the container's own root", processors_quota(root), 3,
           1e-12);
    processors_put("/sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "-1\\n");
    expect("version 1 with no limit", processors_quota(root), 0, 1e-12);
    check_that("there is a processor", processors_allowed() >= 1);
    processors_keep_off();
    char command[64];
    snprintf(command, sizeof command, "rm -r %s", root);
    check_that("the files are removed", system(command) == 0);
    return check_status();
}
