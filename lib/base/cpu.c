/* The processor: which instruction sets it has (cpuid), its name, how it
 * treats denormal numbers, and a clock. */
#include "lib/base/cpu.h"

#include <setjmp.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <time.h>

#include "lib/base/isa.h"

#ifdef SPID_X86
#include <cpuid.h>
#include <immintrin.h>
#include <sys/syscall.h>
#endif

static const char *const level_names[] = { "baseline", "avx2", "avx512" };

/* What the kernels' AVX-512 flags may emit (Makefile, TMPL_avx512) must all
 * be there, or the level is AVX2. */
static enum cpu_level cpu_detect(void)
{
#ifdef SPID_X86
    unsigned a, b, c, d;
    int bf16 = 0;

    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") ||
        !__builtin_cpu_supports("bmi2") || !__builtin_cpu_supports("avx"))
        return CPU_BASELINE;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_F16C))
        return CPU_BASELINE;
    if (__get_cpuid_count(7, 1, &a, &b, &c, &d))
        bf16 = (a >> 5) & 1;
    if (bf16 && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vnni"))
        return CPU_AVX512;
    return CPU_AVX2;
#else
    return CPU_BASELINE;
#endif
}

/* What $SPID_CPU allows; -1: no level. */
static int cpu_cap(void)
{
    const char *cap = getenv("SPID_CPU");
    int i = CPU_AVX512;

    while (cap && *cap && i >= 0 && strcmp(cap, level_names[i]))
        i--;
    return i;
}

int cpu_check(struct error *err)
{
    return cpu_cap() >= 0 ? 0
        : error_set(err, EX_USAGE, "SPID_CPU=%s: not a level (expected "
                    "baseline, avx2 or avx512)", getenv("SPID_CPU"));
}

/* The level found, or $SPID_CPU's when that is lower. */
static enum cpu_level cpu_capped(void)
{
    const int found = (int)cpu_detect(), cap = cpu_cap();

    return (enum cpu_level)(cap >= 0 && cap < found ? cap : found);
}

enum cpu_level cpu_level(void)
{
    static int known = -1; /* every thread would store the same value */
    int level = __atomic_load_n(&known, __ATOMIC_RELAXED);

    if (level < 0) {
        level = (int)cpu_capped();
        __atomic_store_n(&known, level, __ATOMIC_RELAXED);
    }
    return (enum cpu_level)level;
}

const char *cpu_level_name(enum cpu_level level)
{
    return level_names[level];
}

#ifdef SPID_X86
static sigjmp_buf cpu_illegal;

static void cpu_catch(int signal)
{
    siglongjmp(cpu_illegal, signal);
}

/* Loads and releases a configuration without tiles. */
__attribute__((target("amx-tile"))) static void cpu_try_tiles(void)
{
    static const struct { _Alignas(64) uint8_t bytes[64]; } none = { { 1 } };

    _tile_loadconfig(&none);
    _tile_release();
}
#endif

bool cpu_tiles(void)
{
    bool works = false;
#ifdef SPID_X86
    const unsigned wanted = 1u << 22 | 1u << 24 | 1u << 25; /* bf16, tile, int8 */
    const long request = 0x1023, tile_data = 18;    /* ARCH_REQ_XCOMP_PERM */
    struct sigaction now = { .sa_handler = cpu_catch }, before;
    unsigned a, b, c, d;

    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || (d & wanted) != wanted ||
        syscall(SYS_arch_prctl, request, tile_data) ||
        sigaction(SIGILL, &now, &before))
        return false;
    if (!sigsetjmp(cpu_illegal, 1)) {
        cpu_try_tiles();
        works = true;
    }
    sigaction(SIGILL, &before, NULL);
#endif
    return works;
}

bool cpu_is_intel(void)
{
#ifdef SPID_X86
    return __builtin_cpu_is("intel");
#else
    return false;
#endif
}

const char *cpu_name(void)
{
    static char name[128];
    char line[256], *value;
    FILE *f;

    if (name[0])
        return name;
    f = fopen("/proc/cpuinfo", "r");
    while (f && !name[0] && fgets(line, sizeof line, f)) {
        if (strncmp(line, "model name", 10) || !(value = strchr(line, ':')))
            continue;
        value += 1 + strspn(value + 1, " \t");
        value[strcspn(value, "\n")] = '\0';
        snprintf(name, sizeof name, "%.*s", (int)sizeof name - 1, value);
    }
    if (f)
        fclose(f);
    return name[0] ? name : strcpy(name, "unknown");
}

#ifdef __aarch64__
#define FPCR_FZ ((uint64_t)1 << 24)

/* The floating-point control register. */
static uint64_t cpu_fpcr(void)
{
    uint64_t x;

    __asm__ volatile("mrs %0, fpcr" : "=r"(x));
    return x;
}

static void cpu_set_fpcr(uint64_t x)
{
    __asm__ volatile("msr fpcr, %0" : : "r"(x));
}
#endif

void cpu_flush_denormals(void)
{
#if defined(SPID_X86)
    _mm_setcsr(_mm_getcsr() | 0x8040); /* FTZ and DAZ */
#elif defined(__aarch64__)
    cpu_set_fpcr(cpu_fpcr() | FPCR_FZ);
#endif
}

void cpu_keep_denormals(void)
{
#if defined(SPID_X86)
    _mm_setcsr(_mm_getcsr() & ~0x8040u);
#elif defined(__aarch64__)
    cpu_set_fpcr(cpu_fpcr() & ~FPCR_FZ);
#endif
}

unsigned cpu_float_mode(void)
{
#if defined(SPID_X86)
    return _mm_getcsr() & ~0x3fu;       /* without what has happened so far */
#elif defined(__aarch64__)
    return (unsigned)cpu_fpcr();
#else
    return 0;
#endif
}

void cpu_set_float_mode(unsigned mode)
{
#if defined(SPID_X86)
    _mm_setcsr(mode);
#elif defined(__aarch64__)
    cpu_set_fpcr(mode);
#else
    (void)mode;
#endif
}

double cpu_seconds(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
