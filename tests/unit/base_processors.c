/* Quotas of control groups, read from a made /proc and /sys: version 2 and 1,
 * the least of a group and those above it, none set. */
#include "lib/base/processors.h"

#include <stdio.h>
#include <stdlib.h>
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
    char command[64];
    snprintf(command, sizeof command, "rm -r %s", root);
    check_that("the files are removed", system(command) == 0);
    return check_status();
}
