#!/usr/bin/env python3
"""Half of what a run has learned: the mean of two model files' weights.

    mean.py OUT FIRST LAST PREFIX

OUT: a safetensors file with the tensors of both whose names begin with PREFIX,
for spid-train --join.  Between where a run begins and where it ends lies a model
that is often better than both on what it was not trained on (Wortsman and others 2022,
"Robust fine-tuning of zero-shot models").  Needs NumPy.
"""
import sys

import numpy as np

import tensors

KINDS = {"F16": "<f2", "F32": "<f4"}


def weights(path, prefix):
    """Those of real numbers, in single precision."""
    return {name: np.frombuffer(data, KINDS[kind]).reshape(shape).astype("<f4")
            for name, (kind, shape, data) in tensors.read(path)[1].items()
            if name.startswith(prefix) and kind in KINDS}


def main():
    out, first, last, prefix = sys.argv[1:]
    first, last = weights(first, prefix), weights(last, prefix)
    mean = {name: (first[name] + last[name]) / 2 for name in first if name in last}
    if not mean:
        sys.exit(f"mean.py: no tensors {prefix}* in both")
    tensors.write(out, {name: ("F32", m.shape, m.tobytes())
                        for name, m in mean.items()})


if __name__ == "__main__":
    main()
