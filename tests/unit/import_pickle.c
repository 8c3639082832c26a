/* The pickle machine on pickles written here byte by byte: values, arrays,
 * tensors, what is refused and where; views of every kind against the plain
 * definition. */
#include <string.h>

#include "formats/arrayview.h"
#include "lib/lab/import/pickle.h"
#include "tests/check.h"

/* The expression itself is what a failure says. */
#define TRUE(x) CHECK(x, "%s", #x)

#define READ(bytes) pickle_read(bytes, sizeof bytes - 1, &used, &err)

/* {'a': 1, 'b': [True, None, -2.5], 3: 'text'}, protocol 2 */
static void test_values(void)
{
    static const char bytes[] =
        "\x80\x02}q\0(U\1aK\1U\1b]q\1(\x88NG\xc0\4\0\0\0\0\0\0eK\3X\4\0\0\0"
        "textu.and more";
    struct error err = {0};
    size_t used = 0;
    struct pickle *p = READ(bytes);

    REQUIRE(p, "%s", err.text);
    TRUE(used == sizeof bytes - 1 - strlen("and more"));
    const struct pickle_value *root = pickle_root(p);
    const struct pickle_value *a = pickle_get(root, "a");
    const struct pickle_value *b = pickle_get(root, "b");

    TRUE(root->kind == PICKLE_DICT && root->u.list.n == 6);
    TRUE(a && a->kind == PICKLE_INT && a->u.i == 1);
    TRUE(b && b->kind == PICKLE_LIST && b->u.list.n == 3);
    TRUE(b->u.list.item[0]->kind == PICKLE_BOOL &&
          b->u.list.item[0]->u.i == 1);
    TRUE(b->u.list.item[1]->kind == PICKLE_NONE);
    TRUE(b->u.list.item[2]->u.f == -2.5);
    TRUE(root->u.list.item[4]->u.i == 3 &&
          pickle_is(root->u.list.item[5], "text"));
    TRUE(!pickle_get(root, "c"));
    pickle_free(p);
}

/* numpy.array([[1, 2], [3, 4]], '>i2', order='F'), as Python 2 wrote it */
static void test_array(void)
{
    static const char bytes[] =
        "\x80\2cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\n"
        "K\0\x85U\1b\x87R(K\1K\2K\2\x86"
        "cnumpy\ndtype\nU\2i2K\0K\1\x87R(K\3U\1>NNNJ\xff\xff\xff\xff"
        "J\xff\xff\xff\xffK\0tb\x88U\10\0\1\0\3\0\2\0\4tb.";
    struct error err = {0};
    size_t used;
    struct pickle *p = READ(bytes);
    int16_t out[4] = {0};

    REQUIRE(p, "%s", err.text);
    const struct pickle_array *a = pickle_root(p)->u.array;

    TRUE(pickle_root(p)->kind == PICKLE_ARRAY && a->filled && a->known);
    TRUE(a->view.dtype == ST_I16 && a->view.swap && a->view.ndim == 2);
    TRUE(a->view.stride[0] == 1 && a->view.stride[1] == 2);
    array_view_copy(out, &a->view, a->data);
    TRUE(out[0] == 1 && out[1] == 2 && out[2] == 3 && out[3] == 4);
    pickle_free(p);
}

/* torch: the second column of a 3 x 2 storage of half floats */
static void test_tensor(void)
{
    static const char bytes[] =
        "\x80\2ctorch._utils\n_rebuild_tensor_v2\n((U\7storagectorch\n"
        "HalfStorage\nU\1" "7U\3cpuK\6tQK\1K\3\x85K\2\x85\x89"
        "ccollections\nOrderedDict\n)RtR.";
    struct error err = {0};
    size_t used;
    struct pickle *p = READ(bytes);

    REQUIRE(p, "%s", err.text);
    const struct pickle_array *a = pickle_root(p)->u.array;

    TRUE(a->storage && a->storage->count == 6 && a->first == 1);
    TRUE(a->storage->key.n == 1 && a->storage->key.p[0] == '7');
    TRUE(a->view.dtype == ST_F16 && a->view.count == 3 &&
          a->view.stride[0] == 2 && array_view_extent(&a->view) == 5);
    TRUE(pickle_storages(p)->n == 1);
    pickle_free(p);
}

/* What is not known makes an object that does nothing; which was the first is
 * said with opcode and byte. */
static void pickle_object(const char *bytes, size_t size, const char *text)
{
    struct error err = {0};
    struct pickle *p = pickle_read(bytes, size, NULL, &err);
    const char *refused = p ? pickle_refused(p) : NULL;

    CHECK(refused && strstr(refused, text), "\"%s\" (expected \"%s\")",
          refused ? refused : err.text, text);
    pickle_free(p);
}

#define OBJECT(bytes, text) pickle_object(bytes, sizeof bytes - 1, text)

static void test_objects(void)
{
    static const char bytes[] =
        "\x80\2cargparse\nNamespace\n)\x81}U\2lrK\1sb.";
    struct error err = {0};
    size_t used;
    struct pickle *p = READ(bytes);
    char name[PICKLE_FULL_NAME];

    REQUIRE(p, "%s", err.text);
    const struct pickle_object *o = pickle_root(p)->u.object;

    TRUE(pickle_root(p)->kind == PICKLE_OBJECT && !o->items);
    TRUE(o->state && pickle_get(o->state, "lr")->u.i == 1);
    pickle_full_name(name, &o->of);
    TRUE(!strcmp(name, "argparse.Namespace"));
    pickle_free(p);
    OBJECT("cos\nsystem\n(S'true'\ntR.",
           "byte 0: GLOBAL: os.system is not allowed");
    OBJECT("\x80\4\x8c\2os\x8c\6system\x93.",
           "byte 14: STACK_GLOBAL: os.system is not allowed");
    OBJECT("\x80\2cbuiltins\neval\nU\5" "1 + 1\x85R.",
           "byte 2: GLOBAL: builtins.eval is not allowed");
    OBJECT("(S'x'\nios\nsystem\n.", "byte 6: INST: os.system");
    OBJECT("\x80\2c\x01\xff\n \n.", "byte 2: GLOBAL: ??.? is not allowed");
    OBJECT("\x80\2ctorch\nQInt8Storage\n.", "torch.QInt8Storage");
    OBJECT("\x80\2c__main__\nD\n)}\x92K\1K\2s.", "__main__.D is not");
    OBJECT("\x80\2\x82\1.", "byte 2: EXT1: is not allowed");
}

/* The refusal names the opcode and the byte, and nothing is returned. */
static void pickle_refuse(const char *bytes, size_t size, const char *text)
{
    struct error err = {0};
    struct pickle *p = pickle_read(bytes, size, NULL, &err);

    CHECK(!p && strstr(err.text, text), "\"%s\" (expected \"%s\")",
          err.text, text);
    pickle_free(p);
}

#define REFUSE(bytes, text) pickle_refuse(bytes, sizeof bytes - 1, text)

static void test_refusals(void)
{
    REFUSE("\x80\5\x97.", "byte 2: NEXT_BUFFER: is not allowed");
    REFUSE("\x80\2cnumpy\ndtype\nb.", "the stack is empty");
    REFUSE("", "byte 0: end of data: the pickle has no STOP");
    REFUSE("\x80\2U\5abc.", "byte 2: SHORT_BINSTRING: 5 bytes where 4");
    REFUSE("\x80\2U\7storageN\x86Q.", "persistent id is a tuple");
}

/* Random views against element i of the definition. */
static void test_views(void)
{
    unsigned seed = 12345;
    int32_t data[400], out[400];

    for (int i = 0; i < 400; i++)
        data[i] = i;
    for (int round = 0; round < 500; round++) {
        struct array_view v = {.dtype = ST_I32, .ndim = round % 5};
        size_t reach, count;

        for (int k = 0; k < v.ndim; k++)
            v.dim[k] = (seed = seed * 1103515245 + 12345) >> 16 & 3;
        TRUE(array_view_pack(&v, round & 1));
        for (int k = 0; k < v.ndim; k++)
            if (round % 3 == 2)
                v.stride[k] = (seed = seed * 1103515245 + 12345) >> 16 & 31;
        reach = array_view_extent(&v);
        count = 1;
        for (int k = 0; k < v.ndim; k++)
            count *= v.dim[k];
        TRUE(v.count == count && reach <= 400 && !reach == !count);
        array_view_copy(out, &v, data);
        for (size_t i = 0; i < count; i++) {
            size_t at = 0, rest = i;

            for (int k = v.ndim - 1; k >= 0; k--) {
                at += rest % v.dim[k] * v.stride[k];
                rest /= v.dim[k];
            }
            TRUE(out[i] == data[at] && at < reach);
        }
    }
}

int main(void)
{
    test_values();
    test_array();
    test_tensor();
    test_objects();
    test_refusals();
    test_views();
    return check_status();
}
