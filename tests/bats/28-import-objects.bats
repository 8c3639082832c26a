# spid-import: what people's programs pickle beside weights is read as data or
# left out with a line; nothing of it is run.
load helper

prepare() {
    export PYTHONPATH=$BATS_TEST_DIRNAME
}

@test "objects of any class beside arrays, in every protocol, CR LF included" {
    need_numpy
    "$PYTHON" - <<'P'
import argparse, collections, datetime, decimal, enum, functools, pathlib, pickle, uuid
import numpy as np
class Colour(enum.Enum):
    RED = 1
class Slots:
    __slots__ = ["w", "n"]
class Own:
    pass
class Bag(dict):
    pass
class Row(list):
    pass
slots, own, bag, row = Slots(), Own(), Bag(a=np.ones(2)), Row([np.zeros(1), 5])
slots.w, slots.n, own.deep, own.me = np.arange(3), 4, {"x": np.eye(2)}, own
bag.note = "an attribute"
tree = {
    "w": np.arange(4.), "args": argparse.Namespace(lr=1e-3, out=pathlib.Path("a/b")),
    "path": pathlib.PurePosixPath("x"), "colour": Colour.RED, "when": datetime.datetime(2020, 1, 2),
    "lists": collections.defaultdict(list, a=[np.full(2, 7.)]), "none": collections.defaultdict(int),
    "count": collections.Counter("aab"), "order": collections.OrderedDict(z=np.ones(1)),
    "queue": collections.deque([1, 2]), "raw": bytearray(b"abc"), "empty": b"", "nothing": np.zeros((0, 3)),
    "set": {1, 2}, "frozen": frozenset("a"), "part": functools.partial(print, 1), "kind": np.dtype("f4"),
    "type": int, "function": len, "complex": 1 + 2j, "range": range(3), "slice": slice(1, 2),
    "id": uuid.UUID(int=5), "decimal": decimal.Decimal("1.5"), "rng": np.random.RandomState(1),
    "slots": slots, "own": own, "bag": bag, "row": row, "strings": np.array(["a", "b"]),
    "record": np.zeros(2, "f4,i2"), "mask": np.ma.masked_array([1, 2], [0, 1]), "day": np.datetime64("2020-01-01"),
}
want = {"w": np.arange(4.), "lists.a.0": np.full(2, 7.), "order.z": np.ones(1), "nothing": np.zeros((0, 3)),
        "slots.w": np.arange(3), "rng.state.key": tree["rng"].get_state()[1], "own.deep.x": np.eye(2), "bag.a": np.ones(2), "row.0": np.zeros(1)}
pickle.dump(want, open("want", "wb"))
for p in range(6):
    some = dict(tree)
    if p < 2:
        del some["slots"]       # Python cannot
    data = pickle.dumps(some, protocol=p)
    open("%d.pkl" % p, "wb").write(data)
    if p == 0:
        open("crlf.pkl", "wb").write(data.replace(b"\n", b"\r\n"))
P
    for p in 0 1 2 3 4 5 crlf; do
        run spid-import $p.pkl -o $p.safetensors
        [ "$status" -eq 0 ] || { echo "$output"; false; }
        has 'left out: args (argparse.Namespace: no array)'
        has 'left out: path (pathlib.PurePosixPath: no array)'
        [ "$(grep -c 'left out: args' <<<"$output")" -eq 1 ]
        "$PYTHON" - $p <<'P'
import pickle, sys, import_read
want = pickle.load(open("want", "rb"))
if sys.argv[1] in ("0", "1", "crlf"):
    del want["slots.w"]
import_read.check(sys.argv[1] + ".safetensors", want)
P
    done
}

@test "scipy's sparse matrices of every form, in full" {
    need_numpy
    PYTHON=/usr/bin/python3
    "$PYTHON" -c 'import scipy.sparse' 2>/dev/null || skip "no scipy to pickle matrices with (apt: python3-scipy)"
    "$PYTHON" - <<'P'
import pickle
import numpy as np, scipy.sparse as sp
rng = np.random.default_rng(3)
a = np.where(rng.random((6, 8)) < 0.4, rng.standard_normal((6, 8)), 0)
forms = ["csr", "csc", "coo", "lil", "dok", "dia", "bsr"]
tree = {}
for f in forms:
    tree[f] = getattr(sp, f + "_matrix")(a)
    if hasattr(sp, f + "_array"):
        tree[f + "_array"] = getattr(sp, f + "_array")(a)
tree["blocks"] = sp.bsr_matrix(a, blocksize=(3, 2))
tree["twice"] = sp.coo_matrix(([1., 2.], ([0, 0], [1, 1])), shape=(2, 3))
tree["whole"] = sp.csr_matrix(np.arange(6).reshape(2, 3))
tree["none"] = sp.dok_matrix((2, 2))
want = {k: v.toarray().astype("f8") for k, v in tree.items()}
pickle.dump(want, open("want", "wb"))
for p in range(6):
    pickle.dump(tree, open("%d.pkl" % p, "wb"), protocol=p)
pickle.dump(tree["coo"], open("alone.pkl", "wb"))
P
    for p in 0 1 2 3 4 5; do
        spid-import $p.pkl -o $p.safetensors
        "$PYTHON" -c '
import pickle, sys, import_read
import_read.check(sys.argv[1], pickle.load(open("want", "rb")))' $p.safetensors
    done
    spid-import alone.pkl -o alone.safetensors
    "$PYTHON" -c '
import pickle, import_read
import_read.check("alone.safetensors", {"alone": pickle.load(open("want", "rb"))["coo"]})'
}

@test "later scipy's forms, whose places are in coords and _dict" {
    need_numpy
    "$PYTHON" - <<'P'
import pickle, import_read
import numpy as np
form = import_read.make("scipy.sparse._coo", "coo_array")
coo, flat = form(), form()
coo.__dict__.update(_shape=(2, 3), coords=(np.array([0, 1]), np.array([2, 0])), data=np.array([5., 6.]))
dok = import_read.make("scipy.sparse._dok", "dok_array")()
dok.__dict__.update(_shape=(2, 3), _dict={(0, 2): 5.0, (1, 0): np.float64(6)})
flat.__dict__.update(_shape=(3,), coords=(np.array([1]),), data=np.array([5.]))
pickle.dump({"coo": coo, "dok": dok}, open("a.pkl", "wb"))
pickle.dump({"w": np.ones(1), "flat": flat}, open("b.pkl", "wb"))
P
    spid-import a.pkl -o a.safetensors
    run spid-import b.pkl -o b.safetensors
    [ "$status" -eq 0 ]
    has 'left out: flat (scipy.sparse._coo.coo_array: no array)'
    "$PYTHON" -c '
import numpy as np, import_read
m = np.array([[0, 0, 5.], [6, 0, 0]])
import_read.check("a.safetensors", {"coo": m, "dok": m})
import_read.check("b.safetensors", {"w": np.ones(1)})'
}

@test "whole modules of PyTorch give what their state dictionaries give" {
    need_numpy
    PYTHON=/usr/bin/python3
    "$PYTHON" -c 'import torch' 2>/dev/null || skip "no torch to write checkpoints with (apt: python3-torch)"
    "$PYTHON" - <<'P'
import argparse, collections, pathlib
import torch
torch.manual_seed(3)
net = torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.ReLU(),
                          torch.nn.Sequential(torch.nn.BatchNorm2d(4)))
opt = torch.optim.Adam(net.parameters())
net(torch.ones(1, 3, 5, 5)).sum().backward()
opt.step()
beside = dict(args=argparse.Namespace(lr=1, device=torch.device("cpu")), dtype=torch.float32,
              device=torch.device("cuda:0"), count=collections.Counter("ab"), at=pathlib.Path("x"),
              layout=torch.strided, size=torch.Size([1]), complex=torch.ones(2, dtype=torch.complex64),
              quantised=torch.quantize_per_tensor(torch.ones(2), 1., 0, torch.qint8),
              sparse=torch.eye(2).to_sparse(), generator=torch.Generator().get_state())
for name, new in ("new.pt", True), ("old.pth", False):
    if not new:
        del beside["complex"], beside["quantised"]
    torch.save(dict(model=net, opt=opt.state_dict(), **beside), name, _use_new_zipfile_serialization=new)
torch.save(net, "whole.pt")
torch.save(net.state_dict(), "state.pt")
torch.save(dict(model=net.state_dict(), opt=opt.state_dict()), "both.pt")
P
    spid-import state.pt -o state.safetensors
    spid-import whole.pt -o whole.safetensors
    spid-import both.pt -o both.safetensors
    "$PYTHON" -c '
import import_read
import_read.check("whole.safetensors", import_read.load("state.safetensors")[0])'
    for f in new.pt old.pth; do
        run spid-import $f -o out.safetensors
        [ "$status" -eq 0 ] || { echo "$output"; false; }
        has 'left out: dtype (torch.float32: no array)'
        has 'left out: device (torch.device: no array)'
        "$PYTHON" -c '
import import_read
want, got = import_read.load("both.safetensors")[0], import_read.load("out.safetensors")[0]
extra = set(got) - set(want)
assert extra == {"generator"}, extra
got.pop("generator")
import numpy as np
for k in want:
    assert np.array_equal(want[k], got[k]), k'
    done
}

@test "several arrays of objects in one npz" {
    need_numpy
    "$PYTHON" - <<'P'
import pathlib
import numpy as np
np.savez("a.npz", a=np.array({"k": np.ones(2)}, dtype=object), b=np.array([np.eye(2), "x"], dtype=object),
         c=np.arange(3), d=np.array([pathlib.Path("x")], dtype=object))
P
    run spid-import a.npz -o a.safetensors
    [ "$status" -eq 0 ]
    has 'left out: d (pathlib.PosixPath: no array)'
    "$PYTHON" -c '
import numpy as np, import_read
import_read.check("a.safetensors", {"a.k": np.ones(2), "b.0": np.eye(2), "c": np.arange(3)})'
}

@test "a command beside weights is named and not run" {
    need_numpy
    "$PYTHON" - <<'P'
import os, pickle
import numpy as np
class Bad:
    def __reduce__(self):
        return os.system, ("touch executed",)
pickle.dump({"w": np.ones(2), "x": Bad()}, open("bad.pkl", "wb"))
P
    run spid-import bad.pkl -o out.safetensors
    [ "$status" -eq 0 ]
    has 'left out: x (posix.system: no array)'
    [ ! -e executed ]
}
