"""Safetensors files by Python's standard library: what the scripts beside share."""
import json
import os
import struct


def read(path):
    """Metadata, and (dtype, shape, bytes) of each tensor by name."""
    with open(path, "rb") as f:
        (size,) = struct.unpack("<Q", f.read(8))
        head, data = json.loads(f.read(size)), f.read()
    meta = head.pop("__metadata__", {})
    return meta, {name: (t["dtype"], t["shape"], data[slice(*t["data_offsets"])])
                  for name, t in head.items()}


def write(path, tensors, meta=None):
    """The same back, in this order; the file is there when it is whole."""
    head, at = {"__metadata__": meta} if meta else {}, 0
    for name, (dtype, shape, data) in tensors.items():
        head[name] = {"dtype": dtype, "shape": list(shape),
                      "data_offsets": [at, at + len(data)]}
        at += len(data)
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(path + ".part", "wb") as f:
        f.write(struct.pack("<Q", len(text)) + text)
        f.writelines(data for _, _, data in tensors.values())
    os.replace(path + ".part", path)
