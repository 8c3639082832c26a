/* Which instruction set the kernels may use, decided once. */
#ifndef SPID_BASE_CPU_H
#define SPID_BASE_CPU_H

#include <stdbool.h>

#include "lib/base/error.h"
#include "lib/base/isa.h"

enum cpu_level { CPU_BASELINE, CPU_AVX2, CPU_AVX512 };

/* The address of what ISA_VERSIONS declares, the version for this processor. */
#ifdef SPID_X86
#define CPU_PICK(name)                                                        \
    (cpu_level() == CPU_AVX512 ? &name##_avx512                               \
     : cpu_level() == CPU_AVX2 ? &name##_avx2 : &name##_baseline)
#else
#define CPU_PICK(name) (&name##_baseline)
#endif

/* Highest level this processor and system support, capped by $SPID_CPU
 * ("baseline", "avx2", "avx512") so that tests can run every version. */
enum cpu_level cpu_level(void);

/* EX_USAGE where $SPID_CPU is none of these, which is as if it was not set. */
int cpu_check(struct error *err);

/* As $SPID_CPU writes it. */
const char *cpu_level_name(enum cpu_level level);

/* Whether the system lets programs use AMX's tiles of bfloat16 and of 8-bit
 * values, and they work: virtual machines were seen that show them, grant them,
 * and then call their instructions illegal.  Not while another thread counts on
 * its own handler of SIGILL. */
bool cpu_tiles(void);

/* Whether Intel made it. */
bool cpu_is_intel(void);

/* Marketing name of the processor from /proc/cpuinfo, or "unknown". */
const char *cpu_name(void);

/* Flush denormals to zero (FTZ and DAZ of x86, FZ of aarch64) in the calling
 * thread and in every thread that it starts from now on: new threads inherit
 * the mode, and those of lib/base/parallel.h take it from whom they work for.
 * cli_parse does it. */
void cpu_flush_denormals(void);
/* Undo it in the calling thread: for programs that print and convert. */
void cpu_keep_denormals(void);

/* How the calling thread rounds and treats denormals, for another one. */
unsigned cpu_float_mode(void);
void cpu_set_float_mode(unsigned mode);

/* Between two looks at what another thread writes. */
static inline void cpu_relax(void)
{
#ifdef SPID_X86
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

/* Seconds of a monotonic clock. */
double cpu_seconds(void);

#endif
