#!/usr/bin/env python3
"""Half of what a run has learned: the mean of two model files' weights.

    mean.py OUT FIRST LAST PREFIX

OUT: a safetensors file with the tensors of both whose names begin with PREFIX,
for spid-train --join.  Between where a run begins and where it ends lies a model
that is better than both on what it was not trained on (Wortsman and others 2022,
"Robust fine-tuning of zero-shot models").  Needs NumPy.
"""
import json
import struct
import sys

import numpy as np

KINDS = {"F16": "<f2", "F32": "<f4"}


def tensors(path):
    with open(path, "rb") as f:
        (size,) = struct.unpack("<Q", f.read(8))
        head, data = json.loads(f.read(size)), f.read()
    head.pop("__metadata__", None)
    return {name: np.frombuffer(data[slice(*t["data_offsets"])],
                                KINDS[t["dtype"]]).reshape(t["shape"])
            for name, t in head.items() if t["dtype"] in KINDS}


def main():
    out, first, last, prefix = sys.argv[1:]
    first, last = tensors(first), tensors(last)
    head, data = {}, b""
    for name in first:
        if name.startswith(prefix) and name in last:
            mean = (first[name].astype("<f4") + last[name]) / 2
            head[name] = {"dtype": "F32", "shape": mean.shape,
                          "data_offsets": [len(data), len(data) + mean.nbytes]}
            data += mean.astype("<f4").tobytes()
    if not head:
        sys.exit(f"mean.py: no tensors {prefix}* in both")
    text = json.dumps(head).encode()
    with open(out, "wb") as f:
        f.write(struct.pack("<Q", len(text)) + text + data)


if __name__ == "__main__":
    main()
