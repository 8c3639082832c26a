/* libFuzzer target: pickles by their grammar.  The input is a row of choices,
 * each an opcode that the stack allows at that point, with names, strings and
 * numbers from a list of those that mean something; what they make is read as
 * a file of tensors.  fuzz_pickle mutates bytes, and hardly ever gets past the
 * first opcode that lacks its operands. */
#include <string.h>

#include "tests/fuzz/read_tensors.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define ROOM 8192
#define DEEP 64

/* A pickle so far; height of each nesting of marks. */
struct made {
    uint8_t out[ROOM];
    size_t n;
    int height[DEEP], marks, memo;
};

static const char *const name[] = {
    "numpy.core.multiarray\n_reconstruct\n", "numpy\nndarray\n",
    "numpy\ndtype\n", "numpy.core.multiarray\nscalar\n",
    "numpy.core.numeric\n_frombuffer\n", "_codecs\nencode\n",
    "torch._utils\n_rebuild_tensor_v2\n", "torch\nFloatStorage\n",
    "torch._utils\n_rebuild_parameter\n", "torch\nSize\n",
    "torch._tensor\n_rebuild_from_type_v2\n", "torch\nQInt8Storage\n",
    "torch.storage\n_load_from_bytes\n", "collections\nOrderedDict\n",
    "collections\nCounter\n", "builtins\nset\n", "builtins\nbytes\n",
    "builtins\nobject\n", "copyreg\n_reconstructor\n",
    "chumpy.ch\nCh\n", "scipy.sparse._coo\ncoo_matrix\n",
    "scipy.sparse._csr\ncsr_matrix\n", "scipy.sparse._bsr\nbsr_matrix\n",
    "scipy.sparse._dia\ndia_matrix\n", "scipy.sparse._lil\nlil_matrix\n",
    "scipy.sparse._dok\ndok_matrix\n", "argparse\nNamespace\n",
    "__torch__.a\nB\n", "torch.jit._pickle\nbuild_intlist\n", "os\nsystem\n",
};
static const char *const word[] = {
    "storage", "module", "0", "cpu", "latin1", "f8", "i4", "O8", "u1", "<",
    ">", "C", "F", "x", "_shape", "data", "indices", "indptr", "row", "col",
    "coords", "offsets", "rows", "_dict", "_modules", "_parameters", "w",
    "\xc3\xa9\x01", "0123456789abcdef",
};
static const uint8_t number[] = {0, 1, 2, 3, 4, 8, 16, 24, 255};

static void put(struct made *m, const void *p, size_t n)
{
    if (m->n + n > ROOM - DEEP - 2)
        return;
    memcpy(m->out + m->n, p, n);
    m->n += n;
}

static void put_byte(struct made *m, int c)
{
    const uint8_t b = (uint8_t)c;

    put(m, &b, 1);
}

/* A value with no operands, of kind c; k says which. */
static void put_value(struct made *m, unsigned c, unsigned k)
{
    static const char empty[] = "]})\x8fN\x88\x89";
    const char *w = word[k % (sizeof word / sizeof *word)];

    switch (c % 6) {
    case 0:
        put_byte(m, empty[k % (sizeof empty - 1)]);
        break;
    case 1:
        put_byte(m, 'K');
        put_byte(m, number[k % sizeof number]);
        break;
    case 2:
        put_byte(m, 'c');
        put(m, name[k % (sizeof name / sizeof *name)],
            strlen(name[k % (sizeof name / sizeof *name)]));
        break;
    case 3:
        put_byte(m, k & 128 ? 'U' : 0x8c);
        put_byte(m, (int)strlen(w));
        put(m, w, strlen(w));
        break;
    case 4:
        put_byte(m, 'C');
        put_byte(m, 8 * (int)(k % 5));
        for (unsigned i = 0; i < 8 * (k % 5); i++)
            put_byte(m, i % 8 ? 0 : (int)(k % 3));
        break;
    default:
        put_byte(m, 'h');
        put_byte(m, m->memo ? (int)k % m->memo : 0);
        break;
    }
    m->height[m->marks]++;
}

/* An opcode that takes values, if there are enough. */
static void put_operation(struct made *m, unsigned c)
{
    static const struct { char op; int takes, gives; } operation[] = {
        {'R', 2, 1}, {'\x81', 2, 1}, {'b', 2, 1}, {'a', 2, 1}, {'s', 3, 1},
        {'\x85', 1, 1}, {'\x86', 2, 1}, {'\x87', 3, 1}, {'0', 1, 0},
        {'2', 1, 2}, {'Q', 1, 1}, {'\x92', 3, 1}, {'\x93', 2, 1},
    };
    const int n = (int)(c % (sizeof operation / sizeof *operation));
    int *height = &m->height[m->marks];

    if (*height < operation[n].takes)
        return;
    put_byte(m, operation[n].op);
    *height += operation[n].gives - operation[n].takes;
}

/* A mark, or what gathers down to one. */
static void put_gathering(struct made *m, unsigned c)
{
    static const char gather[] = "tldo\x91" "eu\x90";

    if (c % 2 || !m->marks) {
        if (m->marks == DEEP - 1)
            return;
        put_byte(m, '(');
        m->height[++m->marks] = 0;
        return;
    }
    const unsigned k = c / 2 % (sizeof gather - 1);
    const bool into = k > 4;            /* a container below the mark */

    if (into && !m->height[m->marks - 1])
        return;
    put_byte(m, gather[k]);
    m->height[--m->marks] += !into;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct made m;

    memset(&m, 0, sizeof m);
    put(&m, "\x80\x04", 2);
    for (size_t i = 0; i + 1 < size; i += 2) {
        const unsigned c = data[i], k = data[i + 1];

        if (c < 128)
            put_value(&m, c, k);
        else if (c < 200)
            put_operation(&m, k);
        else if (c < 240)
            put_gathering(&m, k);
        else if (m.height[m.marks]) {
            put_byte(&m, 0x94);
            m.memo++;
        }
    }
    while (m.marks) {                   /* one value is to be left */
        m.out[m.n++] = 't';
        m.marks--;
        m.height[m.marks]++;
    }
    for (; m.height[0] > 1 && m.n < ROOM - 1; m.height[0]--)
        m.out[m.n++] = '0';
    m.out[m.n++] = '.';
    return read_tensors(m.out, m.n);
}
