/* Names for code compiled once per instruction set (files *_tmpl.c):
 * ISA(splat_blend) is splat_blend_baseline, _avx2 or _avx512. */
#ifndef SPID_BASE_ISA_H
#define SPID_BASE_ISA_H

#ifdef ISA_NAME
#define ISA_PASTE2(a, b) a##_##b
#define ISA_PASTE(a, b) ISA_PASTE2(a, b)
#define ISA(name) ISA_PASTE(name, ISA_NAME)
#endif

/* SPID_X86 is set where the AVX2 and AVX-512 versions exist; ISA_ONE says that
 * only the baseline is built. */
#if defined(__x86_64__) && !defined(ISA_ONE)
#define SPID_X86 1
#endif

/* Declares what such a file defines as ISA(name), a table of its functions or
 * one of these; CPU_PICK(name) of lib/base/cpu.h points to this processor's. */
#ifdef SPID_X86
#define ISA_VERSIONS(type, name)                                              \
    extern type name##_baseline, name##_avx2, name##_avx512
#else
#define ISA_VERSIONS(type, name) extern type name##_baseline
#endif

#endif
