/* oneDNN's engine and stream, once in a process, and calls of its
 * primitives. */
#include "lib/nn/engine.h"

#include <assert.h>
#include <omp.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/isa.h"

static pthread_once_t once = PTHREAD_ONCE_INIT;
static dnnl_engine_t engine;
static dnnl_stream_t stream;

#ifdef SPID_X86
/* What oneDNN is allowed at most by its own variable, in its own words, from
 * the narrowest on; `max` when it says nothing, or more. */
static dnnl_cpu_isa_t engine_user_limit(dnnl_cpu_isa_t max)
{
    static const struct {
        const char *word;
        dnnl_cpu_isa_t isa;
    } known[] = {
        { "SSE41", dnnl_cpu_isa_sse41 }, { "AVX", dnnl_cpu_isa_avx },
        { "AVX2", dnnl_cpu_isa_avx2 },
        { "AVX512_CORE", dnnl_cpu_isa_avx512_core },
        { "AVX512_CORE_VNNI", dnnl_cpu_isa_avx512_core_vnni },
        { "AVX512_CORE_BF16", dnnl_cpu_isa_avx512_core_bf16 },
        { "AVX512_CORE_AMX", dnnl_cpu_isa_avx512_core_amx }
    };
    const char *word = getenv("ONEDNN_MAX_CPU_ISA");

    word = word ? word : getenv("DNNL_MAX_CPU_ISA");
    for (size_t i = 0; word && i < sizeof known / sizeof *known; i++) {
        if (!strcasecmp(word, known[i].word))
            return known[i].isa;
        if (known[i].isa == max)
            break;
    }
    return max;
}
#endif

/* oneDNN obeys $SPID_CPU as well as its own variable. */
static void engine_limit_instructions(void)
{
#ifdef SPID_X86
    enum cpu_level level = cpu_level();

    dnnl_set_max_cpu_isa(engine_user_limit(
        level == CPU_AVX512 ? cpu_tiles() ? dnnl_cpu_isa_avx512_core_amx
                                          : dnnl_cpu_isa_avx512_core_bf16
        : level == CPU_AVX2 ? dnnl_cpu_isa_avx2 : dnnl_cpu_isa_sse41));
#endif
}

/* Make the engine and its stream; engine stays NULL when either fails. */
static void engine_start(void)
{
    engine_limit_instructions();
    if (dnnl_engine_create(&engine, dnnl_cpu, 0) != dnnl_success) {
        engine = NULL;
        return;
    }
    if (dnnl_stream_create(&stream, engine, dnnl_stream_default_flags) !=
        dnnl_success)
        engine = NULL;
}

/* oneDNN's own threads are OpenMP's, which wait for each other at barriers;
 * work is shared by lib/base/parallel.h instead, and every call of oneDNN is
 * planned and run for the calling thread alone. */
static void engine_one_thread(void)
{
    omp_set_num_threads(1);
}

dnnl_engine_t nn_engine(void)
{
    engine_one_thread();
    pthread_once(&once, engine_start);
    return engine;
}

bool nn_has(dnnl_cpu_isa_t isa)
{
    return nn_engine() && (dnnl_get_effective_cpu_isa() & isa) == isa;
}

bool nn_type_native(enum nn_type type)
{
    return type == NN_INT8 ? nn_has(dnnl_cpu_isa_avx512_core_vnni)
           : type != NN_BF16 || nn_has(dnnl_cpu_isa_avx512_core_bf16);
}

/* Whether there is memory for the instructions of a primitive, which oneDNN
 * writes without asking whether it got any. */
static bool engine_has_room(void)
{
    const size_t room = 4 << 20;        /* of the largest, several times */
    void *p = mmap(NULL, room, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

    return p != MAP_FAILED && munmap(p, room) == 0;
}

void nn_call_init(struct nn_call *c, const_dnnl_primitive_desc_t pd,
                  struct nn_plan *p)
{
    memset(c, 0, sizeof *c);
    if (p->err.code)
        return;
    if (!engine_has_room() ||
        dnnl_primitive_create(&c->prim, pd) != dnnl_success)
        nn_plan_fail(p, EX_OSERR, "oneDNN could not make a primitive");
}

void nn_call_release(struct nn_call *c)
{
    for (int i = 0; i < c->count; i++)
        dnnl_memory_destroy(c->arg[i].memory);
    if (c->prim)
        dnnl_primitive_destroy(c->prim);
    memset(c, 0, sizeof *c);
}

int nn_call_arg(struct nn_call *c, int id, const dnnl_memory_desc_t *md,
                struct nn_plan *p)
{
    if (p->err.code)
        return 0;
    assert(c->count < NN_ARGS);
    c->arg[c->count].arg = id;
    if (dnnl_memory_create(&c->arg[c->count].memory, md, nn_engine(),
                           DNNL_MEMORY_NONE) != dnnl_success) {
        nn_plan_fail(p, EX_OSERR, "oneDNN could not describe an argument");
        return 0;
    }
    return c->count++;
}

size_t nn_call_scratch(struct nn_call *c, const_dnnl_primitive_desc_t pd,
                       struct nn_plan *p)
{
    const dnnl_memory_desc_t *md =
        dnnl_primitive_desc_query_md(pd, dnnl_query_scratchpad_md, 0);
    size_t size = md ? dnnl_memory_desc_get_size(md) : 0;

    nn_call_arg(c, DNNL_ARG_SCRATCHPAD, md, p);
    return size;
}

void nn_call_set(struct nn_call *c, int i, const void *data)
{
    if (c->data[i] == data)
        return;
    c->data[i] = (void *)data;
    dnnl_memory_set_data_handle(c->arg[i].memory, (void *)data);
}

void nn_call_run(struct nn_call *c)
{
    engine_one_thread();
    dnnl_status_t status =
        dnnl_primitive_execute(c->prim, stream, c->count, c->arg);
    assert(status == dnnl_success);
    (void)status;
}
