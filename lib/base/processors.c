/* The affinity mask and control groups, as Linux shows them in /proc and
 * /sys. */
#include "lib/base/processors.h"

#include <math.h>
#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define PROCESSORS_MAX 8192    /* processors of a mask */

/* As the process began; empty where it cannot be told. */
static cpu_set_t allowed[PROCESSORS_MAX / CPU_SETSIZE];
static pthread_once_t allowed_read = PTHREAD_ONCE_INIT;

static void processors_read_allowed(void)
{
    if (sched_getaffinity(0, sizeof allowed, allowed))
        CPU_ZERO_S(sizeof allowed, allowed);
}

/* In the mask, at least 1. */
static int processors_of_mask(void)
{
    int n;

    pthread_once(&allowed_read, processors_read_allowed);
    n = CPU_COUNT_S(sizeof allowed, allowed);
    if (n == 0)
        n = (int)sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n;
}

/* The first words of the file root/folder/name as two numbers; how many there
 * are ("max" is none). */
static int processors_read(double v[2], const char *root, const char *folder,
                           const char *path, const char *name)
{
    char file[4096];
    int n = snprintf(file, sizeof file, "%s%s%s/%s", root, folder, path, name);
    FILE *f = n < (int)sizeof file ? fopen(file, "r") : NULL;

    n = f ? fscanf(f, "%lf %lf", &v[0], &v[1]) : 0;
    if (f)
        fclose(f);
    return n < 0 ? 0 : n;
}

/* The quota of one group, in processors; 0: none. */
static double processors_of_group(const char *root, const char *path,
                                  bool second)
{
    static const char *const folder[] = {"/sys/fs/cgroup/cpu",
                                         "/sys/fs/cgroup/cpu,cpuacct"};
    double v[2], period[2];

    if (second)
        return processors_read(v, root, "/sys/fs/cgroup", path,
                               "cpu.max") == 2 && v[1] > 0 ? v[0] / v[1] : 0;
    for (int i = 0; i < 2; i++)
        if (processors_read(v, root, folder[i], path,
                            "cpu.cfs_quota_us") == 1 && v[0] > 0 &&
            processors_read(period, root, folder[i], path,
                            "cpu.cfs_period_us") == 1 && period[0] > 0)
            return v[0] / period[0];
    return 0;
}

/* The least of the group at path and of all above it: a container may see its
 * own group as the root. */
static double processors_up(const char *root, char *path, bool second)
{
    double min = 0;

    for (;;) {
        const double q = processors_of_group(root, path, second);
        char *slash = strrchr(path, '/');

        if (q > 0 && (min == 0 || q < min))
            min = q;
        if (!slash)
            return min;
        *slash = 0;
    }
}

/* Whether "cpu" is among the controllers "a,b,c". */
static bool processors_is_cpu(const char *controllers)
{
    for (const char *at = controllers; at; at = strchr(at, ',')) {
        at += *at == ',';
        if (!strncmp(at, "cpu", 3) && (at[3] == ',' || at[3] == 0))
            return true;
    }
    return false;
}

double processors_quota(const char *root)
{
    char file[4096], *line = NULL;
    double min = 0;
    size_t room = 0;
    FILE *f = NULL;

    if (snprintf(file, sizeof file, "%s/proc/self/cgroup", root) <
        (int)sizeof file)
        f = fopen(file, "r");
    while (f && getline(&line, &room, f) > 0) {     /* number:controllers:path */
        char *controllers = strchr(line, ':');
        char *path = controllers ? strchr(controllers + 1, ':') : NULL;

        if (!path)
            continue;
        *path++ = 0;
        path[strcspn(path, "\n")] = 0;
        const bool second = controllers[1] == 0;
        const double q = second || processors_is_cpu(controllers + 1)
                             ? processors_up(root, path, second) : 0;
        if (q > 0 && (min == 0 || q < min))
            min = q;
    }
    free(line);
    if (f)
        fclose(f);
    return min;
}

void processors_avoid(pthread_t thread, const int *taken, int count)
{
    cpu_set_t left[PROCESSORS_MAX / CPU_SETSIZE];
    const bool nice = getpriority(PRIO_PROCESS, 0) > 0;

    pthread_once(&allowed_read, processors_read_allowed);
    memcpy(left, allowed, sizeof left);
    for (int i = 0; i < count && !nice; i++)
        CPU_CLR_S((size_t)taken[i], sizeof left, left);     /* < 0: beyond it */
    pthread_setaffinity_np(thread, sizeof left,
                           CPU_COUNT_S(sizeof left, left) ? left : allowed);
}

int processors_allowed(void)
{
    const int mask = processors_of_mask();
    const double quota = ceil(processors_quota(""));

    return quota > 0 && quota < mask ? (int)quota : mask;
}
