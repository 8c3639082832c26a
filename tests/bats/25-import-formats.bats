# spid-import: what comes out is what went in, in every form.
load helper

prepare() {
    export PYTHONPATH=$BATS_TEST_DIRNAME
}

need_torch() {
    need_numpy
    PYTHON=/usr/bin/python3
    "$PYTHON" -c 'import torch, numpy' 2>/dev/null ||
        skip "no torch to write checkpoints with (apt: python3-torch)"
}

# A checkpoint with every type, views of all sorts and things that are no
# tensors, in both of PyTorch's forms; want.pkl: what to expect of it.
torch_files() {
    "$PYTHON" - <<'P'
import pickle
from collections import OrderedDict
import numpy as np, torch
torch.manual_seed(1)
net = torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.BatchNorm2d(4))
base = torch.arange(24.).reshape(4, 6)
tree = OrderedDict(
    model=net.state_dict(),
    views=dict(whole=base, turned=base.t(), part=base[1:3, ::2],
               row=base[2], spread=torch.tensor([7.]).expand(3, 2),
               deep=torch.arange(120).reshape(2, 3, 4, 5).permute(3, 1, 0, 2)),
    half=torch.tensor([1.5, -2, 65504]).half(),
    bf16=torch.tensor([1.5, -2, 3e38]).bfloat16(),
    double=torch.arange(3.).double(), long=torch.arange(5),
    int=torch.arange(3, dtype=torch.int32),
    short=torch.arange(-1, 3, dtype=torch.int16),
    char=torch.arange(-2, 3, dtype=torch.int8),
    byte=torch.arange(3, dtype=torch.uint8), bool=torch.tensor([True, False]),
    scalar=torch.tensor(3.25), empty=torch.zeros(0, 3),
    parameter=torch.nn.Parameter(torch.ones(2, 2)),
    list=[torch.ones(1), 2, None, (torch.zeros(2), "x")],
    epoch=3, name="a name", rate=1e-3, numpy=np.arange(6.).reshape(2, 3),
    number=np.float64(2.5), fortran=np.asfortranarray(np.eye(3)[:2]),
    big=np.arange(3, dtype=">f4"))
torch.save(tree, "new.pt")
torch.save(tree, "old.pth", _use_new_zipfile_serialization=False)
want = {}
def walk(path, v):
    if isinstance(v, torch.Tensor):
        v = v.detach().contiguous()
        want[path] = v.view(torch.int16).numpy().view("<u2") \
            if v.dtype == torch.bfloat16 else v.numpy()
    elif isinstance(v, (np.ndarray, np.generic)):
        want[path] = np.asarray(v)
    elif isinstance(v, dict):
        for k, x in v.items():
            walk(f"{path}.{k}" if path else str(k), x)
    elif isinstance(v, (list, tuple)):
        for k, x in enumerate(v):
            walk(f"{path}.{k}", x)
walk("", tree)
pickle.dump(want, open("want.pkl", "wb"))
P
}

@test "PyTorch checkpoints of both forms, tensor for tensor" {
    need_torch
    torch_files
    for f in new.pt old.pth; do
        spid-import "$f" -o out.safetensors
        "$PYTHON" - "$f" <<'P'
import pickle, sys
import import_read
meta = import_read.check("out.safetensors", pickle.load(open("want.pkl", "rb")))
assert meta["source_format"] == {"new.pt": "PyTorch zip",
    "old.pth": "PyTorch, older form"}[sys.argv[1]], meta
assert len(meta["source_xxh128"]) == 32 and "kind" not in meta
P
    done
}

@test "--list prints tensors, and values that are none behind #" {
    need_torch
    torch_files
    spid-import new.pt --list >list
    grep -qxF $'views.turned\tF32\t[6, 4]' list
    grep -qxF $'bf16\tBF16\t[3]' list
    grep -qxF $'scalar\tF32\t[]' list
    grep -qxF '# epoch: int' list
    grep -qxF '# list.3.1: text' list
    [ "$(grep -vc '^#' list)" -eq "$("$PYTHON" -c '
import pickle; print(len(pickle.load(open("want.pkl", "rb"))))')" ]
}

@test "the same file gives the same bytes, and safetensors come back as they were" {
    need_torch
    torch_files
    spid-import new.pt -o a.safetensors
    cp new.pt elsewhere.bin
    spid-import elsewhere.bin -o b.safetensors
    cmp a.safetensors b.safetensors
    spid-import a.safetensors -o c.safetensors
    "$PYTHON" -c '
import import_read
import_read.check("c.safetensors", import_read.load("a.safetensors")[0])'
}

@test "TorchScript: what its modules hold, as a state dictionary has it" {
    need_torch
    "$PYTHON" - <<'P'
import torch
torch.manual_seed(2)
net = torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.Sequential(torch.nn.BatchNorm2d(4))).eval()
torch.save(net.state_dict(), "state.pth")
torch.jit.trace(net, torch.ones(1, 3, 5, 5)).save("script.zip")
P
    spid-import state.pth -o state.safetensors
    spid-import script.zip -o script.safetensors
    "$PYTHON" -c '
import import_read
import_read.check("script.safetensors", import_read.load("state.safetensors")[0])'
}

@test "pickles of all protocols: numpy, scipy, chumpy, strings" {
    need_numpy
    "$PYTHON" - <<'P'
import pickle
import numpy as np
import import_read
chumpy, sparse = import_read.classes()
rng = np.random.default_rng(1)
J = np.where(rng.random((5, 9)) < 0.4, rng.random((5, 9)), 0)
big = rng.random((4, 5)).astype(">f8")
f = rng.integers(0, 9, (6, 3)).astype("u4")
tree = {"v_template": chumpy(np.arange(6.).reshape(2, 3)), "J": sparse(J),
        "R": sparse(J, rows=True), "f": f, "big": big,
        "turned": np.asfortranarray(big), "half": np.arange(3, dtype="f2"),
        "flag": np.array([True, False]), "one": np.float32(0.5),
        "bytes": np.frombuffer(bytes(range(256)), "u1"),
        "object": np.array({"x": np.ones(2)}, dtype=object),
        "s": "h\u00e9 \u20ac \\ \n", "n": [1, 2.5, None, True, {4}, 10 ** 30]}
want = {"v_template": np.arange(6.).reshape(2, 3), "J": J, "R": J, "f": f,
        "big": big, "turned": big, "half": np.arange(3, dtype="f2"),
        "flag": np.array([True, False]), "one": np.float32(0.5),
        "bytes": np.arange(256, dtype="u1"), "object.x": np.ones(2)}
pickle.dump(want, open("want", "wb"))
for p in range(6):
    pickle.dump(tree, open("%d.pkl" % p, "wb"), protocol=p)
P
    for p in 0 1 2 3 4 5; do
        spid-import $p.pkl -o $p.safetensors
        "$PYTHON" -c '
import pickle, sys, import_read
import_read.check(sys.argv[1], pickle.load(open("want", "rb")))' $p.safetensors
    done
}

@test "Python 2's pickles: byte strings as data and as latin1 names" {
    need_numpy
    # {'d\xe9j\xe0': array([1., 2.]), u'n': array([3], '>i2')}, protocol 2 by
    # hand, and protocol 0 with its quoted string
    "$PYTHON" - <<'P'
def string(s): return b"U" + bytes([len(s)]) + s
def dtype(s, order): return (b"cnumpy\ndtype\n" + string(s) + b"K\x00K\x01\x87R(K\x03" +
    string(order) + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb")
def array(n, d, data): return (b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\n"
    b"K\x00\x85" + string(b"b") + b"\x87R(K\x01K" + bytes([n]) + b"\x85" + d + b"\x89" + data + b"tb")
import struct
two = struct.pack("<2d", 1, 2)
open("two.pkl", "wb").write(b"\x80\x02}(" + string(b"d\xe9j\xe0") +
    array(2, dtype(b"f8", b"<"), b"T" + struct.pack("<I", 16) + two) + b"X\x01\x00\x00\x00n" +
    array(1, dtype(b"i2", b">"), string(b"\x00\x03")) + b"u.")
quoted = b"S'" + b"".join(b"\\x%02x" % c if not 32 < c < 127 or c in b"\\'" else bytes([c]) for c in two) + b"'\n"
open("zero.pkl", "wb").write(b"(dS'a'\n" + array(2, dtype(b"f8", b"<"), quoted) + b"s.")
P
    spid-import two.pkl -o two.safetensors
    spid-import zero.pkl -o zero.safetensors
    "$PYTHON" -c '
import numpy as np, import_read
import_read.check("two.safetensors", {"d\u00e9j\u00e0": np.array([1., 2.]),
                                      "n": np.array([3], "i2")})
import_read.check("zero.safetensors", {"a": np.array([1., 2.])})'
}

@test "numpy's npy and npz, packed, transposed, big-endian, of objects" {
    need_numpy
    "$PYTHON" - <<'P'
import numpy as np
a = np.arange(24, dtype=">i2").reshape(2, 3, 4)
np.save("turned.npy", a.T)
np.save("scalar.npy", np.float64(3))
np.savez("z.npz", a=a, f=np.asfortranarray(np.eye(3, 2)), text=np.array(["x"]))
np.savez_compressed("c.npz", zeros=np.zeros((300, 100)), objects=np.array(
    {"face": np.arange(5), "deep": [np.ones(2), "x"]}, dtype=object))
np.save("objects.npy", {"face": np.arange(5)})
P
    for f in turned.npy scalar.npy z.npz c.npz objects.npy; do
        spid-import $f -o ${f%.*}.safetensors
    done
    "$PYTHON" - <<'P'
import numpy as np, import_read
a = np.arange(24, dtype="i2").reshape(2, 3, 4)
import_read.check("turned.safetensors", {"turned": a.T})
import_read.check("scalar.safetensors", {"scalar": np.float64(3)})
import_read.check("z.safetensors", {"a": a, "f": np.eye(3, 2)})
import_read.check("c.safetensors", {"zeros": np.zeros((300, 100)),
    "objects.face": np.arange(5), "objects.deep.0": np.ones(2)})
import_read.check("objects.safetensors", {"face": np.arange(5)})
P
}

@test "torch tensors inside of numpy objects, as landmark embeddings have" {
    need_torch
    "$PYTHON" - <<'P'
import numpy as np, torch
np.save("mixed.npy", {"a": np.arange(3), "t": torch.arange(6).reshape(2, 3).t(),
                      "b": torch.rand(4)[1:]})
d = np.load("mixed.npy", allow_pickle=True)[()]
np.savez("want.npz", a=d["a"], t=d["t"].numpy(), b=d["b"].numpy())
P
    spid-import mixed.npy -o mixed.safetensors
    "$PYTHON" -c '
import numpy as np, import_read
import_read.check("mixed.safetensors", dict(np.load("want.npz")))'
}

@test "a compressed checkpoint and one of a foreign byte order" {
    need_torch
    "$PYTHON" - <<'P'
import numpy as np, torch, zipfile
x = torch.arange(6.).reshape(2, 3)
torch.save({"x": x}, "x.pt")
with zipfile.ZipFile("x.pt") as z, zipfile.ZipFile("packed.pt", "w", zipfile.ZIP_DEFLATED) as p, \
        zipfile.ZipFile("big.pt", "w") as b:
    for n in z.namelist():
        p.writestr(n, z.read(n))
        b.writestr(n, np.frombuffer(z.read(n), "<f4").astype(">f4").tobytes() if "/data/" in n else z.read(n))
    b.writestr(z.namelist()[0].split("/")[0] + "/byteorder", "big")
np.save("x.npy", x.numpy())
P
    for f in packed big; do
        spid-import $f.pt -o $f.safetensors
        "$PYTHON" -c '
import sys, numpy as np, import_read
import_read.check(sys.argv[1], {"x": np.load("x.npy")})' $f.safetensors
    done
}

@test "wrong use and files that are not there" {
    status 64 spid-import
    one_line
    printf x >x
    status 64 spid-import x
    has 'no output file'
    status 64 spid-import x -o y --as flamingo
    has 'expected flame, dinov2, smirk'
    status 66 spid-import nothing.pt -o y
    has 'nothing.pt: No such file'
    status 66 spid-import . -o y
    has 'not a regular file'
    [ ! -e y ] && [ ! -e y.part ]
}

@test "a full disk leaves nothing" {
    [ -e /dev/full ] || skip "no /dev/full (Linux)"
    need_numpy
    "$PYTHON" -c 'import numpy as np; np.save("a.npy", np.zeros(100000))'
    status 74 spid-import a.npy -o /dev/full
    one_line
    status 73 spid-import a.npy -o nowhere/out.safetensors
    one_line
}
