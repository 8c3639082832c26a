/* What the opcodes (pickle.c, pickle_constant.c) and the constructors
 * (pickle_call.c, pickle_torch.c) share. */
#ifndef SPID_LAB_IMPORT_PICKLE_MACHINE_H
#define SPID_LAB_IMPORT_PICKLE_MACHINE_H

#include "lib/base/arena.h"
#include "lib/lab/import/pickle.h"

#define PICKLE_LINE 4096        /* longest line that holds a number */

/* The names whose meaning is known; all others make objects. */
enum pickle_known {
    NAME_NONE,
    NAME_OBJECT, NAME_SET, NAME_BYTES, NAME_ENCODE, NAME_RECONSTRUCTOR,
    NAME_ORDERED_DICT, NAME_SCRIPT, NAME_LIST,
    NAME_NDARRAY, NAME_DTYPE, NAME_RECONSTRUCT, NAME_SCALAR, NAME_FROMBUFFER,
    NAME_TENSOR, NAME_PARAMETER, NAME_SUBCLASS, NAME_SIZE, NAME_LOAD,
    NAME_STORAGE            /* + enum st_dtype */
};

/* Memory of many small values; used counts all but long strings. */
struct pickle_arena {
    struct arena memory;
    char *block;            /* that is being filled */
    size_t left;            /* in it */
    size_t used;
};

struct pickle {
    struct pickle_arena arena;
    struct pickle_value *root;
    struct pickle_list storages;    /* every one that was named */
    struct error refused;           /* pickle_refused; no text: nothing */
};

struct pickle_machine {
    const unsigned char *data;
    size_t size, at;        /* at: of the next byte to read */
    size_t op_at;           /* of the opcode */
    const char *op;         /* its name, */
    enum pickle_kind kind;  /* the kind of the value that it makes, */
    size_t n;               /* and the bytes or values that it takes */
    struct pickle *p;
    struct pickle_value **stack;    /* NULL: a mark */
    size_t top, room;
    struct pickle_value **memo;
    size_t memo_room;
    size_t memoized;        /* entries in use */
    size_t decoded;         /* bytes of strings that were read once more */
    size_t strings;         /* and of those that were written anew */
    bool stopped;
    bool inner;             /* a pickle in a string of another */
    bool crlf;              /* its lines end in CR and LF */
    size_t lines;           /* read so far */
    struct error *err;
};

/* What returns int is 0, or -1 with *m->err; what returns a pointer, NULL. */

/* "byte N: OPCODE: text" in *m->err; returns -1. */
int pickle_fail(struct pickle_machine *m, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* The same from a function of pointers: NULL. */
#define pickle_null(...) (pickle_fail(__VA_ARGS__), NULL)
/* Zeroed memory that lives as long as the pickle. */
void *pickle_alloc(struct pickle_machine *m, size_t bytes);
/* The same for a string, which counts by the size of the pickle. */
char *pickle_alloc_string(struct pickle_machine *m, size_t bytes);
/* A zeroed value of that kind, which lives as long as the pickle. */
struct pickle_value *pickle_make(struct pickle_machine *m,
                                 enum pickle_kind kind);
/* Room for n more items; append one. */
int pickle_reserve(struct pickle_machine *m, struct pickle_list *l, size_t n);
/* v at the end of l. */
int pickle_append(struct pickle_machine *m, struct pickle_list *l,
                  struct pickle_value *v);

/* The next n bytes; a little-endian number of n bytes, at most 8; the rest of
 * a line without its end; the same as a string. */
const unsigned char *pickle_bytes(struct pickle_machine *m, uint64_t n);
/* A little-endian number of n bytes, at most 8. */
int pickle_number(struct pickle_machine *m, size_t n, uint64_t *out);
/* The rest of a line, without its end. */
int pickle_line(struct pickle_machine *m, struct pickle_text *line);
/* The same as a string that ends in 0; a longer one is cut. */
int pickle_number_line(struct pickle_machine *m, char out[PICKLE_LINE]);

/* v NULL: it could not be made, which is passed on. */
int pickle_push(struct pickle_machine *m, struct pickle_value *v);
/* A mark: what later opcodes gather down to. */
int pickle_push_mark(struct pickle_machine *m);
/* The topmost value, which is not a mark. */
struct pickle_value *pickle_top(struct pickle_machine *m);
/* The same, taken off the stack. */
struct pickle_value *pickle_pop(struct pickle_machine *m);
/* Index of the first value above the topmost mark; 0 and *m->err without. */
size_t pickle_marked(struct pickle_machine *m);
/* Those values go to the end of l; the mark goes too. */
int pickle_move(struct pickle_machine *m, struct pickle_list *l, size_t from);
/* Entry i of the memo is the topmost value; push entry i. */
int pickle_memo_put(struct pickle_machine *m, uint64_t i);
/* Push entry i of the memo. */
int pickle_memo_get(struct pickle_machine *m, uint64_t i);

/* pickle_read; `inner`: of one in a string of another, which may not hold a
 * third. */
struct pickle *pickle_read_any(const void *data, size_t size, size_t *used,
                               bool inner, struct error *err);

/* What module and name stand for, NAME_NONE when that is not known. */
int pickle_lookup(struct pickle_text module, struct pickle_text name);
/* What calling `name` with a tuple of arguments gives. */
struct pickle_value *pickle_call(struct pickle_machine *m,
                                 const struct pickle_name *name,
                                 const struct pickle_value *args);
/* An object of class `name`, made without arguments. */
struct pickle_value *pickle_new(struct pickle_machine *m,
                                const struct pickle_name *name);
/* An object that name, which may be NULL, and the values in args are all there
 * is to know of; args may be NULL. */
struct pickle_value *pickle_make_object(struct pickle_machine *m,
                                        const struct pickle_name *name,
                                        const struct pickle_list *args);
/* Remember why an object had to be made, if it is the first. */
void pickle_refuse(struct pickle_machine *m, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* Room for items of that kind in an object; NULL: out of memory. */
struct pickle_value *pickle_object_items(struct pickle_machine *m,
                                         struct pickle_value *object,
                                         enum pickle_kind kind);
/* BUILD: give the object below its state. */
int pickle_op_build(struct pickle_machine *m);
/* A storage from its persistent id, the tuple
 * ('storage', type, key, place, elements[, view of another]). */
struct pickle_value *pickle_persistent(struct pickle_machine *m,
                                       const struct pickle_value *id);

/* ---- arguments of a constructor ------------------------------------------ */

/* Item i of a tuple; NULL when it has fewer. */
struct pickle_value *pickle_item(const struct pickle_value *t, size_t i);
/* Of that kind; v may be NULL, which is of none. */
bool pickle_is_kind(const struct pickle_value *v, enum pickle_kind kind);
/* A whole number that is not negative; `what` it is, for the message. */
int pickle_take_size(struct pickle_machine *m, size_t *out,
                     const struct pickle_value *v, const char *what);
/* A tuple of at most 8 sizes, or a bare one; returns how many, or -1. */
int pickle_take_sizes(struct pickle_machine *m, size_t out[ARRAY_VIEW_DIMS],
                      const struct pickle_value *v, const char *what);
/* A string is read once more; all such may be as long as the pickle. */
int pickle_read_again(struct pickle_machine *m, const struct pickle_value *s);
/* A new, empty array. */
struct pickle_value *pickle_make_array(struct pickle_machine *m);

/* ---- PyTorch's constructors (pickle_torch.c) ---------------------------- */

/* (storage, offset, size, stride, ..): a view of a storage. */
struct pickle_value *pickle_torch_tensor(struct pickle_machine *m,
                                         const struct pickle_value *args);
/* (bytes): a storage alone in PyTorch's older form, pickled as a string.  The
 * number, the version and the machine are left unread. */
struct pickle_value *pickle_torch_load(struct pickle_machine *m,
                                       const struct pickle_value *args);
/* (function, class, arguments, state): a tensor of another class, as the
 * function makes it. */
struct pickle_value *pickle_torch_subclass(struct pickle_machine *m,
                                           const struct pickle_value *args);
/* (tensor, ..): the tensor. */
struct pickle_value *pickle_torch_parameter(struct pickle_machine *m,
                                            const struct pickle_value *args);
/* (tuple): the tuple. */
struct pickle_value *pickle_torch_size(struct pickle_machine *m,
                                       const struct pickle_value *args);

/* ---- opcodes of constants (pickle_constant.c) --------------------------- */

/* Each pushes a value of m->kind; n: m->n, the bytes of the number, or of the
 * length of the string, behind the opcode. */

/* None, True and False: n is the value. */
int pickle_op_constant(struct pickle_machine *m);
/* A decimal line, with or without the L of Python 2. */
int pickle_op_int_line(struct pickle_machine *m);
/* A number of n bytes; only four have a sign. */
int pickle_op_int(struct pickle_machine *m);
/* Two's complement, lowest byte first, behind a length of n bytes. */
int pickle_op_long(struct pickle_machine *m);
/* A line of text, as strtod reads it. */
int pickle_op_float_line(struct pickle_machine *m);
/* Eight bytes, highest first. */
int pickle_op_float(struct pickle_machine *m);
/* A string behind its length of n bytes. */
int pickle_op_string(struct pickle_machine *m);
/* Latin1, and other characters as \uXXXX or \UXXXXXXXX. */
int pickle_op_text_line(struct pickle_machine *m);
/* A literal of Python 2, in quotes. */
int pickle_op_string_line(struct pickle_machine *m);

#endif
