/* Children: found beside this program, started, waited for. */
#include "lib/lab/bench/bench_process.h"

#include <spawn.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

extern char **environ;

int process_find(char *path, const char *name, struct error *err)
{
    ssize_t n = readlink("/proc/self/exe", path, PROCESS_PATH - 32);
    char *slash;

    path[n > 0 ? n : 0] = 0;
    slash = strrchr(path, '/');
    if (slash && strlen(name) < 32)
        strcpy(slash + 1, name);
    if (!slash || access(path, X_OK))
        return error_set(err, EX_NOINPUT, "no %s beside this program", name);
    return 0;
}

int process_begin(const char *const *args, int in, struct error *err)
{
    posix_spawn_file_actions_t redirect;
    pid_t child;
    int rc = posix_spawn_file_actions_init(&redirect);

    if (rc)
        return error_set(err, EX_OSERR, "out of memory");
    if (in >= 0)
        rc = posix_spawn_file_actions_adddup2(&redirect, in, STDIN_FILENO);
    if (rc == 0)
        rc = posix_spawnp(&child, args[0], &redirect, NULL,
                          (char *const *)args, environ);
    posix_spawn_file_actions_destroy(&redirect);
    return rc ? error_set(err, EX_OSERR, "%s: %s", args[0], strerror(rc))
              : child;
}

static double process_seconds(struct timeval t)
{
    return (double)t.tv_sec + 1e-6 * (double)t.tv_usec;
}

int process_end(int child, const char *name, struct process_cost *cost,
                struct error *err)
{
    struct rusage used;
    int status;

    if (wait4(child, &status, 0, &used) != child || status)
        return error_set(err, EX_SOFTWARE, "%s did not finish", name);
    if (cost)
        *cost = (struct process_cost){
            .seconds = process_seconds(used.ru_utime) +
                       process_seconds(used.ru_stime),
            .peak = (double)used.ru_maxrss / 1024
        };
    return 0;
}

int process_run(const char *const *args, int in, struct process_cost *cost,
                struct error *err)
{
    int child = process_begin(args, in, err);

    return child < 0 ? -1 : process_end(child, args[0], cost, err);
}
