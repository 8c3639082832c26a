"""Write files that try to harm whoever opens them, and hostile.txt: one line
per file with its name and a part of the message that must refuse it.  Plain
Python, written byte by byte: nothing of numpy or PyTorch is needed."""
import io
import struct
import zipfile
import zlib

made = []


def put(name, data, message):
    with open(name, "wb") as f:
        f.write(data)
    made.append((name, message))


def text(s):
    s = s.encode()
    return b"X" + struct.pack("<I", len(s)) + s


def number(n):
    if 0 <= n < 256:
        return b"K" + bytes([n])
    return b"\x8a\x08" + struct.pack("<q", n)


def numbers(*v):
    return b"(" + b"".join(number(n) for n in v) + b"t"


def name(module, attribute):
    return b"c" + module.encode() + b"\n" + attribute.encode() + b"\n"


# ---- names that run something --------------------------------------------

TOUCH = text("touch executed") + b"\x85R."
calls = [("os", "system"), ("posix", "system"), ("nt", "system"),
         ("builtins", "eval"), ("__builtin__", "eval"), ("builtins", "exec"),
         ("builtins", "getattr"), ("subprocess", "Popen"),
         ("runpy", "_run_code"), ("torch", "load"), ("torch.hub", "load"),
         ("pickle", "loads"), ("numpy", "load"), ("shutil", "rmtree"),
         ("collections", "OrderedDict.__reduce__"),
         ("numpy.testing._private.utils", "runstring")]
for i, (module, attribute) in enumerate(calls):
    put("call%d.pkl" % i, b"\x80\x02" + name(module, attribute) + TOUCH,
        "byte 2: GLOBAL: %s.%s is not allowed" % (module, attribute))
put("stack_global.pkl", b"\x80\x04\x8c\x02os\x8c\x06system\x93" + TOUCH,
    "byte 14: STACK_GLOBAL: os.system is not allowed")
put("inst.pkl", b"(" + text("touch executed") + b"ios\nsystem\n.",
    "INST: os.system is not allowed")
put("obj.pkl", b"(" + name("collections", "OrderedDict") + b"o.",
    "OBJ: is not allowed")
put("newobj_ex.pkl", b"\x80\x04" + name("collections", "OrderedDict") +
    b")}\x92.", "NEWOBJ_EX: is not allowed")
put("extension.pkl", b"\x80\x02\x82\x01.", "EXT1: is not allowed")
put("persid.pkl", b"Pos.system\n.", "PERSID: is not allowed")
put("buffer.pkl", b"\x80\x05\x97.", "NEXT_BUFFER: is not allowed")
put("in_dict.pkl", b"\x80\x02}" + text("model") + name("os", "popen") +
    text("touch executed") + b"\x85Rs.", "GLOBAL: os.popen is not allowed")
put("call_object.pkl", b"\x80\x02" + number(7) + b")R.",
    "REDUCE: of a int and a tuple")
put("call_class.pkl", b"\x80\x02" + name("numpy", "ndarray") + b")R.",
    "REDUCE: ndarray is not a function to call")
put("setstate.pkl", b"\x80\x02]}b.", "BUILD: of a list")
put("script_call.pkl", b"\x80\x02" + name("__torch__.os", "system") +
    text("touch executed") + b"\x85R.",
    "REDUCE: a class of TorchScript is not a function to call")
put("script_like.pkl", b"\x80\x02" + name("__torch__os", "system") + b".",
    "GLOBAL: __torch__os.system is not allowed")
put("script_list.pkl", b"\x80\x02" + name("torch.jit._pickle", "build_intlist") +
    number(7) + b"\x85R.", "REDUCE: list of a int")
put("codec.pkl", b"\x80\x02" + name("_codecs", "encode") + text("x") +
    text("zip") + b"\x86R.", "encode of other than text in latin1")
put("reconstructor.pkl", name("copy_reg", "_reconstructor") + b"(" +
    name("numpy", "dtype") + name("__builtin__", "object") + b"NtR.",
    "dtype is not a class to make things of")

# ---- bombs ----------------------------------------------------------------

laughs = b"\x80\x02]q\x00(K\x01K\x01K\x01e0"
for i in range(60):
    laughs += b"]q" + bytes([i + 1]) + b"(" + (b"h" + bytes([i])) * 10 + b"e0"
put("laughs.pkl", laughs + b"h\x3c.", "shared ones counted again")
put("cycle.pkl", b"\x80\x02]q\x00h\x00a.", "nested more than 64 deep")
put("deep.pkl", b"\x80\x02" + b"]" * 5000 + b"a" * 4999 + b".",
    "nested more than 64 deep")
put("objects.pkl", b"\x80\x02" + b"]0" * 3000000 + b".",
    "more than 64 MB of objects")
put("stack.pkl", b"\x80\x02" + b"(" * 3000000 + b".",
    "more than 1048576 values on the stack")
put("memo.pkl", b"\x80\x02Nr\xff\xff\xff\xff.",
    "LONG_BINPUT: memo entry 4294967295")
put("memo_get.pkl", b"\x80\x02h\x07.", "BINGET: memo entry 7 is empty")
put("bytes8.pkl", b"\x80\x04\x8e" + b"\xff" * 8 + b".",
    "BINBYTES8: 18446744073709551615 bytes where 1 are left")
put("unicode.pkl", b"\x80\x02X\xff\xff\xff\x7fab.",
    "BINUNICODE: 2147483647 bytes where 3 are left")
put("long4.pkl", b"\x80\x02\x8b\xff\xff\xff\x7f\x01.",
    "LONG4: 2147483647 bytes")
put("frame.pkl", b"\x80\x04\x95" + b"\xff" * 8 + b"N.", "FRAME: ")
again = b"\x80\x02" + name("_codecs", "encode") + b"q\x00" + text(
    "x" * 1000) + text("latin1") + b"\x86q\x01R0" + b"h\x00h\x01R0" * 1000
put("encode_again.pkl", again + b"N.", "the same bytes too many times")

# ---- broken streams -------------------------------------------------------

put("no_stop.pkl", b"\x80\x02N", "the pickle has no STOP")
put("underflow.pkl", b"\x80\x02a.", "APPEND: the stack is empty")
put("no_mark.pkl", b"\x80\x02NNt.", "TUPLE: no mark on the stack")
put("two_left.pkl", b"\x80\x02NN.", "STOP: 1 values are left on the stack")
put("odd_dict.pkl", b"\x80\x02}(Nu.", "SETITEMS: a key without a value")
put("protocol.pkl", b"\x80\x63N.", "PROTO: protocol 99")
put("opcode.pkl", b"\x80\x02\xfe.", "byte 2: 0xfe is not an opcode")
put("mark_top.pkl", b"\x80\x02(.", "STOP: the stack is empty")

# ---- arrays that lie ------------------------------------------------------

DTYPE = (name("numpy", "dtype") + text("f8") + b"K\x00K\x01\x87R(K\x03" +
         text("<") + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb")


def array(shape, data, dtype=DTYPE):
    return (name("numpy.core.multiarray", "_reconstruct") +
            name("numpy", "ndarray") + numbers(0) + b"C\x01b\x87R(K\x01" +
            shape + dtype + b"\x89B" + struct.pack("<I", len(data)) + data +
            b"tb")


def pickled(body):
    return b"\x80\x03}" + text("a") + body + b"s."


put("array_long.pkl", pickled(array(numbers(1 << 40), bytes(8))),
    "array of 1099511627776 elements of F64 has 8 bytes")
put("array_short.pkl", pickled(array(numbers(0), bytes(8))),
    "array of 0 elements of F64 has 8 bytes")
put("array_wrap.pkl", pickled(array(numbers(1 << 32, 1 << 32), b"")),
    "shape of an array is too large")
put("array_negative.pkl", pickled(array(numbers(-1), b"")),
    "shape of an array is negative")
put("array_dims.pkl", pickled(array(numbers(*[1] * 9), bytes(8))),
    "shape of an array has 9 numbers")
put("array_text.pkl", pickled(array(numbers(1), bytes(8))[:-15] +
                              text("x") + b"tb"),
    "BUILD: data of an array are a text (expected bytes)")
put("array_empty.pkl", pickled(
    name("numpy.core.multiarray", "_reconstruct") + name("numpy", "ndarray") +
    numbers(0) + b"C\x01b\x87R"), "tensor 'a': the array is never filled in")
put("twice.pkl", b"\x80\x03}(" + (text("a") + array(numbers(1), bytes(8))) *
    2 + b"u.", "two tensors are named 'a'")
put("control.pkl", b"\x80\x03}" + text("\n") + array(numbers(1), bytes(8)) +
    b"s.", "holds no tensors")
put("nameless.pkl", b"\x80\x03}" + text("") + array(numbers(1), bytes(8)) +
    b"s.", "a tensor is named ''")


def sparse(rows, columns, data, indices, starts, lines=("csc", "csc_matrix")):
    i4 = DTYPE.replace(text("f8"), text("i4"))
    return (name("scipy.sparse." + lines[0], lines[1]) + b")\x81}(" +
            text("_shape") + numbers(rows, columns) + text("data") +
            array(numbers(len(data)), struct.pack("<%dd" % len(data), *data))
            + text("indices") + array(numbers(len(indices)), struct.pack(
                "<%di" % len(indices), *indices), i4) + text("indptr") +
            array(numbers(len(starts)), struct.pack(
                "<%di" % len(starts), *starts), i4) + b"ub")


put("sparse_outside.pkl", pickled(sparse(2, 2, [1, 1], [0, 7], [0, 1, 2])),
    "has an index outside")
put("sparse_backwards.pkl", pickled(sparse(2, 2, [1, 1], [0, 1], [0, 2, 1])),
    "has an index outside")
put("sparse_huge.pkl", pickled(sparse(1 << 40, 1, [1], [0], [0, 1])),
    "sparse matrix of 1099511627776 by 1 with 1 entries")
put("sparse_double.pkl", pickled(sparse(1, 1, [1] * 9, [0] * 9, [0, 9])),
    "sparse matrix of 1 by 1 has 9 numbers")
put("chumpy.pkl", pickled(name("chumpy.ch", "Ch") + b")\x81}b"),
    "chumpy array whose x is missing")
put("chumpy_new.pkl", pickled(name("chumpy.ch", "Ch") + b")\x81"),
    "'a' is a chumpy array without one")

# ---- PyTorch --------------------------------------------------------------


def storage(key, count, kind="FloatStorage"):
    return (b"(" + text("storage") + name("torch", kind) + text(key) +
            text("cpu") + number(count) + b"tQ")


def tensor(size, stride, key="0", count=4, offset=0, kind="FloatStorage"):
    return (name("torch._utils", "_rebuild_tensor_v2") + b"(" +
            storage(key, count, kind) + number(offset) + numbers(*size) +
            numbers(*stride) + b"\x89" + name("collections", "OrderedDict") +
            b")RtR")


def torch_zip(tree, data=bytes(16), key="0", how=zipfile.ZIP_STORED):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", how) as z:
        z.writestr("archive/data.pkl", tree)
        z.writestr("archive/data/" + key, data)
        z.writestr("archive/version", "3\n")
    return out.getvalue()


def checkpoint(body):
    return b"\x80\x02}" + text("w") + body + b"s."


put("zip_system.pt", torch_zip(b"\x80\x02" + name("os", "system") + TOUCH),
    "archive/data.pkl: byte 2: GLOBAL: os.system is not allowed")
put("zip_missing.pt", torch_zip(checkpoint(tensor([4], [1])), key="1"),
    "tensor 'w': no entry archive/data/0")
put("zip_short.pt", torch_zip(checkpoint(tensor([5], [1], count=5))),
    "tensor 'w': storage of 5 elements of F32, but archive/data/0 has 16")
put("zip_reach.pt", torch_zip(checkpoint(tensor([2, 2], [4, 1]))),
    "REDUCE: tensor of 4 elements from 0 on, reaching 6 further")
put("zip_offset.pt", torch_zip(checkpoint(tensor([2], [1], offset=3))),
    "REDUCE: tensor of 2 elements from 3 on, reaching 2 further")
put("zip_expand.pt", torch_zip(checkpoint(tensor([1 << 20, 1 << 20],
                                                 [0, 0]))),
    "tensor 'w': all tensors together take more than 16 times the file")
put("zip_stride.pt", torch_zip(checkpoint(tensor([2], [-1], offset=1))),
    "stride of a tensor is negative")
put("zip_wrap.pt", torch_zip(checkpoint(tensor([2, 2], [1 << 62, 1 << 62]))),
    "REDUCE: tensor of 4 elements")
put("zip_key.pt", torch_zip(checkpoint(tensor([4], [1], key="../../0"))),
    "tensor 'w': storage with an odd key")
put("zip_quantised.pt", torch_zip(checkpoint(tensor(
    [4], [1], kind="QInt8Storage"))), "torch.QInt8Storage is not allowed")
put("storage_alone.pkl", checkpoint(tensor([4], [1])),
    "PyTorch storages alone")

good = torch_zip(checkpoint(tensor([4], [1])))
flipped = bytearray(good)
flipped[good.index(b"archive/data/0") + 14] ^= 1
put("zip_sum.pt", bytes(flipped), "tensor 'w': archive/data/0: CRC error")
put("zip_cut.pt", good[:-30], "not a sound zip archive")
central = good.rindex(b"PK\1\2", 0, good.rindex(b"archive/data/0"))
lying = bytearray(good)
struct.pack_into("<II", lying, central + 20, 1 << 30, 1 << 30)
put("zip_lying.pt", bytes(lying), "not a sound zip archive")
secret = bytearray(good)
secret[central + 8] |= 1
secret[good.index(b"PK\3\4", 10) + 6] |= 1
put("zip_encrypted.pt", bytes(secret), "is encrypted")

bomb = torch_zip(checkpoint(tensor([1 << 25], [1], count=1 << 25)),
                 bytes(1 << 27), how=zipfile.ZIP_DEFLATED)
put("zip_bomb.pt", bomb, "archive/data/0: 134217728 bytes from")


def entry(name_of, data, packed=None, method=0, at=None, out=None, size=None):
    """One entry by hand: a local header unless it lies where `at` says."""
    packed = data if packed is None else packed
    size = len(data) if size is None else size
    head = struct.pack("<HHHHHIIIHH", 20, 0, method, 0, 33, zlib.crc32(data),
                       len(packed), size, len(name_of), 0)
    if at is None:
        at = len(out)
        out += b"PK\3\4" + head + name_of + packed
    return (b"PK\1\2" + struct.pack("<H", 20) + head +
            struct.pack("<HHHII", 0, 0, 0, 0, at) + name_of)


def by_hand(make):
    out = bytearray()
    directory = make(out)
    start = len(out)
    out += b"".join(directory)
    return bytes(out + b"PK\5\6" + struct.pack(
        "<HHHHIIH", 0, 0, len(directory), len(directory),
        len(out) - start, start, 0))


NPY = b"\x93NUMPY\1\0\x46\0" + b"{'descr': '<f4', 'fortran_order': False, " \
      b"'shape': (2,), }".ljust(69) + b"\n" + bytes(8)


def twice(out):
    first = entry(b"a.npy", NPY, out=out)
    return [first, first]


def inside(out):
    """The second entry lies inside of the first one's data."""
    inner = b"PK\3\4" + struct.pack("<HHHHHIIIHH", 20, 0, 0, 0, 33,
                                    zlib.crc32(NPY), len(NPY), len(NPY), 5,
                                    0) + b"b.npy" + NPY
    first = entry(b"a.npy", inner, out=out)
    return [first, entry(b"b.npy", NPY, at=len(out) - len(inner))]


put("zip_twice.npz", by_hand(twice), "not a sound zip archive")
put("zip_inside.npz", by_hand(inside), "")
put("zip_double.npz", by_hand(lambda out: [entry(b"a.npy", NPY, out=out),
                                           entry(b"a.npy", NPY, out=out)]),
    "File already exists")
put("zip_method.npz", by_hand(lambda out: [entry(
    b"a.npy", NPY, packed=NPY, method=12, out=out)]), "compression method 12")
deflated = zlib.compress(NPY)[2:-4]
put("zip_more.npz", by_hand(lambda out: [entry(
    b"a.npy", NPY, deflated, 8, out=out, size=len(NPY) - 4)]),
    "a.npy: shape does not fit the 4 bytes")
put("zip_fewer.npz", by_hand(lambda out: [entry(
    b"a.npy", NPY, deflated, 8, out=out, size=len(NPY) + 4)]), "a.npy: ")
put("zip_other.npz", by_hand(lambda out: [entry(b"readme", b"hello",
                                                out=out)]),
    "readme: is no array")
put("zip_nothing.npz", by_hand(lambda out: []), "holds no tensors")
put("npz_shape.npz", by_hand(lambda out: [entry(
    b"a.npy", NPY.replace(b"(2,)", b"(9,)"), out=out)]),
    "a.npy: shape does not fit the 8 bytes")
put("npz_object.npz", by_hand(lambda out: [entry(
    b"a.npy", NPY.replace(b"<f4'", b"|O' ")[:80] + b"\x80\x02" +
    name("os", "system") + TOUCH, out=out)]),
    "a.npy: byte 2: GLOBAL: os.system is not allowed")
put("npy_long.npy", b"\x93NUMPY\2\0\xff\xff\xff\xff{}", "not an npy file")
put("npy_shape.npy", NPY.replace(b"(2,)", b"(3,)"), "shape does not fit")
put("npy_cut.npy", NPY[:40], "not an npy file")

# ---- PyTorch's older form -------------------------------------------------

MAGIC = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19."
VERSION = b"\x80\x02M\xe9\x03."


def legacy(tree, keys=b"\x80\x02](" + text("0") + b"e.",
           data=struct.pack("<Q", 4) + bytes(16), version=VERSION):
    return MAGIC + version + b"\x80\x02}." + tree + keys + data


def legacy_tensor(size, stride, count=4):
    return tensor(size, stride, count=count).replace(b"tQ", b"NtQ")


tree = checkpoint(legacy_tensor([4], [1]))
put("legacy_system.pth", legacy(b"\x80\x02" + name("os", "system") + TOUCH),
    "pickle at byte 25: byte 2: GLOBAL: os.system is not allowed")
put("legacy_count.pth", legacy(tree, data=struct.pack("<Q", 1 << 61)),
    "storage 0 has 2305843009213693952 elements of F32")
put("legacy_cut.pth", legacy(tree, data=struct.pack("<Q", 4) + bytes(15)),
    "storage 0 has 4 elements of F32")
put("legacy_few.pth", legacy(tree, data=struct.pack("<Q", 3) + bytes(12)),
    "storage of 4 elements of F32, but the file has 3")
put("legacy_key.pth", legacy(tree, keys=b"\x80\x02](" + text("9") + b"e."),
    "storage 0 of the list is not one of the tensors'")
put("legacy_none.pth", legacy(tree, keys=b"\x80\x02]."),
    "tensor 'w': its storage is not in the file")
put("legacy_version.pth", legacy(tree, version=b"\x80\x02K\x01."),
    "PyTorch's version is not 1001")
put("legacy_no_keys.pth", legacy(tree, keys=b""), "pickle at byte")
nested = legacy(b"\x80\x02" + storage("0", 1 << 40).replace(b"tQ", b"NtQ") +
                b".")
put("inner_count.pkl", pickled(
    name("torch._utils", "_rebuild_tensor_v2") + b"(" +
    name("torch.storage", "_load_from_bytes") + b"B" +
    struct.pack("<I", len(nested)) + nested + b"\x85RK\x00" + numbers(4) +
    numbers(1) + b"\x89" + name("collections", "OrderedDict") + b")RtR"),
    "holds no storage of 1099511627776 elements")
put("tar.pth", b"sys_info".ljust(257, b"\0") + b"ustar".ljust(300, b"\0"),
    "tar form of 2016 is not read")

# ---- files of nothing -----------------------------------------------------

put("empty.pt", b"", "empty.pt: empty")
put("text.bin", b"hello, world\n", "neither safetensors, zip, npy nor a sound pickle: byte 0: ")
put("numbers.pkl", b"\x80\x02](K\x01K\x02e.", "holds no tensors")
put("safetensors.bin", struct.pack("<Q", 100) + b'{"a":' + bytes(3),
    "header of 100 bytes in a file of 16")
# 150,000 names, of which the last is the first: each against all others took
# minutes.
entries = ",".join('"t%d":{"dtype":"U8","shape":[0],"data_offsets":[0,0]}'
                   % (i % 149999) for i in range(150000))
put("many.safetensors", struct.pack("<Q", len(entries) + 2) + b"{" +
    entries.encode() + b"}", "tensor 't0' occurs twice")

with open("hostile.txt", "w") as f:
    for file, message in made:
        f.write(file + "\t" + message + "\n")
