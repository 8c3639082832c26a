"""Read safetensors without the toolkit, for comparing with what was imported;
bfloat16 as its bits."""
import json
import struct

import numpy as np

TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2",
         "I64": "<i8", "I32": "<i4", "I16": "<i2", "I8": "i1", "U8": "u1",
         "U16": "<u2", "U32": "<u4", "U64": "<u8", "BOOL": "?"}


def load(path):
    """The tensors by name, and the metadata."""
    raw = open(path, "rb").read()
    n = struct.unpack("<Q", raw[:8])[0]
    head = json.loads(raw[8:8 + n])
    meta = head.pop("__metadata__", {})
    data = raw[8 + n:]
    return {k: np.frombuffer(data[slice(*v["data_offsets"])],
                             TYPES[v["dtype"]]).reshape(v["shape"])
            for k, v in head.items()}, meta


def check(path, want):
    """The file holds these arrays, of these types, and no others."""
    got, meta = load(path)
    assert sorted(got) == sorted(want), set(got) ^ set(want)
    for name, x in want.items():
        x = np.asarray(x)
        same = x.dtype.newbyteorder("<")
        assert got[name].dtype.newbyteorder("<") == same, (name, x.dtype)
        assert got[name].shape == x.shape, (name, got[name].shape, x.shape)
        assert np.array_equal(got[name], x), name
    return meta


def make(module, name):
    """A class as pickles know it, by name and state, whether its package is
    there or not."""
    import sys
    import types

    parts = module.split(".")
    for i in range(len(parts)):
        at = ".".join(parts[:i + 1])
        sys.modules.setdefault(at, types.ModuleType(at))
    cls = type(name, (object,), {"__module__": module})
    setattr(sys.modules[module], name, cls)
    return cls


def classes():
    """scipy's and chumpy's classes."""
    ch = make("chumpy.ch", "Ch")
    csc = make("scipy.sparse.csc", "csc_matrix")
    csr = make("scipy.sparse.csr", "csr_matrix")

    def chumpy(x):
        out = ch()
        out.__dict__.update(x=x, _dirty_vars={"x"}, _itr=None, _parents=[])
        return out

    def sparse(x, rows=False):
        x = np.asarray(x)
        lines = x if rows else x.T
        at = [np.flatnonzero(line) for line in lines]
        out = csr() if rows else csc()
        out.__dict__.update(
            _shape=x.shape, maxprint=50,
            data=np.concatenate([l[i] for l, i in zip(lines, at)]),
            indices=np.concatenate(at).astype("i4"),
            indptr=np.cumsum([0] + [len(i) for i in at]).astype("i4"))
        return out

    return chumpy, sparse
