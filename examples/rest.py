#!/usr/bin/env python3
"""What the motion encoder says of calm faces, for a model file.

    rest.py OUT STREAM...

STREAM: spid-motion's of one neutral photograph each.  OUT: a safetensors file
with the tensor motion.rest (spid-model(5)), which spid-train --join takes: for
each number of the encoder's output what a twentieth of the photographs is below,
and what a twentieth is above.  Pose and gaze are not of the face and stay free.
"""
import struct
import sys

import tensors
from spidstream import read_stream

OUT, EXP, JAW, LID = 120, 9, 109, 112   # of lib/net/motion_encoder.h
SHARE = 0.05                            # tests/bench/README.md says why
FREE = 60000.0                          # fits half precision


def row(path):
    """Expression, jaw and lids where the encoder's output has them."""
    with open(path, "rb") as f:
        for rec in read_stream(f):
            if rec.type == "MOTN":
                out = [None] * OUT
                for name, at in (("exp", EXP), ("jaw", JAW), ("lid", LID)):
                    for i, x in enumerate(rec.arrays[name].values()):
                        out[at + i] = x
                return out
    sys.exit(f"rest.py: {path}: no MOTN record")


def quantile(values, share):
    """Linear between neighbours."""
    v, at = sorted(values), share * (len(values) - 1)
    k = min(int(at), len(v) - 2)
    return v[k] + (at - k) * (v[k + 1] - v[k])


def main():
    if len(sys.argv) < 4:
        sys.exit("usage: rest.py OUT STREAM STREAM...")
    rows = [row(p) for p in sys.argv[2:]]
    rest = []
    for share, free in ((SHARE, -FREE), (1 - SHARE, FREE)):
        rest += [free if c[0] is None else quantile(c, share)
                 for c in zip(*rows)]
    data = struct.pack("<%df" % len(rest), *rest)
    tensors.write(sys.argv[1], {"motion.rest": ("F32", [2, OUT], data)})


if __name__ == "__main__":
    main()
