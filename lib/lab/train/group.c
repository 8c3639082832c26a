/* Sums over processes by MPI where there is one; without it, a group of one
 * in which they do nothing. */
#include "lib/lab/train/group.h"

#include <limits.h>
#include <stdlib.h>
#include <sysexits.h>

#ifdef SPID_MPI
#include <mpi.h>

/* mpirun of the common implementations says so in the environment; without
 * it MPI_Init would only cost time, or fail where no daemon runs. */
static bool group_launched(void)
{
    return getenv("OMPI_COMM_WORLD_SIZE") || getenv("PMI_SIZE") ||
           getenv("PMIX_RANK");
}

/* 0, or -1 with MPI's own words. */
static int group_check(int rc, const char *what, struct error *err)
{
    char text[MPI_MAX_ERROR_STRING] = "";
    int length;

    if (rc == MPI_SUCCESS)
        return 0;
    MPI_Error_string(rc, text, &length);
    return error_set(err, EX_OSERR, "%s between processes failed: %s", what,
                     text);
}

int group_init(struct group *g, struct error *err)
{
    g->rank = 0;
    g->size = 1;
    if (!group_launched())
        return 0;
    if (group_check(MPI_Init(NULL, NULL), "start", err))
        return -1;
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
    MPI_Comm_rank(MPI_COMM_WORLD, &g->rank);
    MPI_Comm_size(MPI_COMM_WORLD, &g->size);
    return 0;
}

void group_release(struct group *g)
{
    int up = 0;

    MPI_Initialized(&up);
    if (up)
        MPI_Finalize();
    g->rank = 0;
    g->size = 1;
}

/* x[n] of a type = sum over the group, in parts that an int can count. */
static int group_sum_type(const struct group *g, void *x, size_t n,
                          size_t size, MPI_Datatype type, struct error *err)
{
    size_t max = 1 << 24;

    if (g->size < 2)
        return 0;
    for (size_t at = 0; at < n; at += max) {
        int count = (int)(n - at < max ? n - at : max);
        if (group_check(MPI_Allreduce(MPI_IN_PLACE, (char *)x + at * size,
                                      count, type, MPI_SUM, MPI_COMM_WORLD),
                        "sum", err))
            return -1;
    }
    return 0;
}

int group_sum(const struct group *g, float *x, size_t n, struct error *err)
{
    return group_sum_type(g, x, n, sizeof *x, MPI_FLOAT, err);
}

int group_sum_double(const struct group *g, double *x, size_t n,
                     struct error *err)
{
    return group_sum_type(g, x, n, sizeof *x, MPI_DOUBLE, err);
}

int group_any(const struct group *g, bool *flag, struct error *err)
{
    int x = *flag;

    if (g->size < 2)
        return 0;
    if (group_check(MPI_Allreduce(MPI_IN_PLACE, &x, 1, MPI_INT, MPI_MAX,
                                  MPI_COMM_WORLD),
                    "vote", err))
        return -1;
    *flag = x != 0;
    return 0;
}

void group_abort(const struct group *g, int code)
{
    if (g->size > 1)
        MPI_Abort(MPI_COMM_WORLD, code);
}

#else

int group_init(struct group *g, struct error *err)
{
    (void)err;
    g->rank = 0;
    g->size = 1;
    return 0;
}

void group_release(struct group *g)
{
    (void)g;
}

int group_sum(const struct group *g, float *x, size_t n, struct error *err)
{
    (void)g, (void)x, (void)n, (void)err;
    return 0;
}

int group_sum_double(const struct group *g, double *x, size_t n,
                     struct error *err)
{
    (void)g, (void)x, (void)n, (void)err;
    return 0;
}

int group_any(const struct group *g, bool *flag, struct error *err)
{
    (void)g, (void)flag, (void)err;
    return 0;
}

void group_abort(const struct group *g, int code)
{
    (void)g, (void)code;
}

#endif
