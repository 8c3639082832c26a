/* spid: runs spid-VERB from its own directory or the PATH, and says what it
 * found (spid doctor). */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cmd/cli.h"
#include "formats/safetensors.h"
#include "lib/base/cpu.h"
#include "lib/base/file.h"
#include "lib/base/parallel.h"
#include "lib/base/processors.h"
#include "lib/nn/nn.h"

static const struct cli_option options[] = {{0}};
static const struct cli_usage usage = {
    "spid", "VERB [ARGUMENT...] | doctor [-m MODEL]",
    "run a program of the SpiD toolkit", options
};

/* ---- verbs ------------------------------------------------------------- */

/* For qsort. */
static int spid_by_name(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* The programs beside this one. */
static void spid_list_verbs(FILE *to, const char *dir)
{
    char *name[64];
    size_t n = 0;
    DIR *d = opendir(*dir ? dir : ".");

    if (!d)
        return;
    for (struct dirent *e; n < 64 && (e = readdir(d));)
        if (strncmp(e->d_name, "spid-", 5) == 0 && !strchr(e->d_name, '.'))
            name[n++] = strdup(e->d_name + 5);
    closedir(d);
    qsort(name, n, sizeof *name, spid_by_name);
    fputs("verbs:", to);
    for (size_t i = 0; i < n; i++) {
        fprintf(to, " %s", name[i]);
        free(name[i]);
    }
    fputs(" doctor\n", to);
}

/* Become spid-VERB; returns only when there is none. */
static void spid_run_verb(const char *dir, char **argv)
{
    char path[4200];

    snprintf(path, sizeof path, "%sspid-%s", dir, argv[0]);
    if (access(path, X_OK) == 0) {
        execv(path, argv);
        die(EX_OSERR, "%s: %s", path, strerror(errno));
    }
    snprintf(path, sizeof path, "spid-%s", argv[0]);
    execvp(path, argv);
}

/* ---- doctor ------------------------------------------------------------ */

/* What /proc/meminfo says. */
static void spid_print_memory(void)
{
    char line[160];
    FILE *f = fopen("/proc/meminfo", "r");

    while (f && fgets(line, sizeof line, f))
        if (strncmp(line, "MemTotal:", 9) == 0)
            printf("memory      %.1f GB\n", strtod(line + 9, NULL) / 1e6);
    if (f)
        fclose(f);
}

/* One file of the model search: where it is and what it holds. */
static int spid_print_model(const char *name)
{
    struct error err = {0};
    char path[4096];

    if (cli_find_model(name, path, sizeof path, &err)) {
        printf("%-11s missing: %s\n", *name == 'h' ? "head" : "model",
               err.text);
        return 1;
    }
    struct safetensors *st = st_open(path, &err);
    if (!st) {
        printf("%-11s damaged: %s\n", *name == 'h' ? "head" : "model",
               err.text);
        return 1;
    }
    const char *config = st_meta(st, "spid");
    printf("%-11s %s, %zu tensors\n", *name == 'h' ? "head" : "model", path,
           st_count(st));
    if (config && *name == 'm')
        printf("            %s\n", config);
    st_close(st);
    return 0;
}

/* The shared libraries this system would load for the heavy programs. */
static void spid_print_library(const char *what, const char *pattern)
{
    static const char *const roots[] = {
        "/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu",
        "/usr/lib64", "/usr/local/lib", "/usr/lib"
    };

    for (size_t i = 0; i < sizeof roots / sizeof *roots; i++) {
        DIR *d = opendir(roots[i]);
        char best[256] = "";

        for (struct dirent *e; d && (e = readdir(d));)
            if (strncmp(e->d_name, pattern, strlen(pattern)) == 0 &&
                strlen(e->d_name) > strlen(best))
                snprintf(best, sizeof best, "%s", e->d_name);
        if (d)
            closedir(d);
        if (best[0]) {
            printf("%-11s %s/%s\n", what, roots[i], best);
            return;
        }
    }
    printf("%-11s not found\n", what);
}

/* Everything that a bug report should say; not 0 when a file is missing. */
static int spid_run_doctor(void)
{
    int bad = 0;

    printf("spid        %s\n", SPID_VERSION);
    printf("processor   %s\n", cpu_name());
    printf("kernels     %s%s\n", cpu_level_name(cpu_level()),
           nn_type_native(NN_BF16) ? ", bf16 native" : "");
    printf("threads     %d of %d processors\n", parallel_width(),
           processors_allowed());
    spid_print_memory();
    spid_print_library("oneDNN", "libdnnl.so.");
    spid_print_library("OpenCV", "libopencv_core.so.");
    spid_print_library("OpenImageIO", "libOpenImageIO.so.");
    spid_print_library("libpng", "libpng16.so.");
    spid_print_library("xxHash", "libxxhash.so.");
    bad |= spid_print_model("head.safetensors");
    bad |= spid_print_model("model.safetensors");
    return bad ? EX_CONFIG : 0;
}

int main(int argc, char **argv)
{
    char dir[4096];

    file_own_folder(dir, sizeof dir);
    if (argc > 1 && argv[1][0] != '-' && strcmp(argv[1], "doctor")) {
        spid_run_verb(dir, argv + 1);
        spid_list_verbs(stderr, dir);
        cli.program = "spid";
        die(EX_USAGE, "%s: no such verb", argv[1]);
    }
    int first = cli_parse(&usage, argc, argv);
    if (first == argc) {
        spid_list_verbs(stderr, dir);
        die(EX_USAGE, "no verb (expected one of these)");
    }
    return spid_run_doctor();
}
