#!/usr/bin/env python3
"""Read and write SpiD record streams; written from spid-stream(5) alone.

    for rec in read_stream(sys.stdin.buffer):
        print(rec.type, rec.frame, rec.arrays["jaw"].values())

Python's standard library only; where NumPy is installed, Array.numpy() is an
array and Array.of(x) the way back, so that a stage in between is

    for rec in read_stream(sys.stdin.buffer):
        if rec.type == "MOTN":
            rec.arrays["jaw"] = Array.of(1.2 * rec.arrays["jaw"].numpy())
        out.write(rec)          # out = Writer(sys.stdout.buffer)

As a program it prints each record as
`spid-dump --json` does, or with --copy writes the stream again:

    spid-motion clip.mp4 | examples/spidstream.py
"""
import json
import math
import signal
import struct
import sys

HEADER = struct.Struct("<4sHH4sIQdQQQQ")
ENTRY = struct.Struct("<24sII4IQQ")
DTYPES = [("u8", "B", 1), ("i32", "i", 4), ("f16", "e", 2), ("f32", "f", 4),
          ("f64", "d", 8)]
MAX_BYTES = 1 << 30


class StreamError(Exception):
    """The stream is damaged or cut short."""


class Array:
    def __init__(self, dtype, shape, data):
        self.dtype, self.shape, self.data = dtype, tuple(shape), bytes(data)

    def values(self):
        """All elements in row-major order."""
        letter, size = next(d[1:] for d in DTYPES if d[0] == self.dtype)
        return struct.unpack("<%d%s" % (len(self.data) // size, letter),
                             self.data)

    def numpy(self):
        """The elements as a NumPy array of this shape, not to be written."""
        import numpy
        kind = {"u8": "u1", "i32": "<i4", "f16": "<f2", "f32": "<f4",
                "f64": "<f8"}[self.dtype]
        return numpy.frombuffer(self.data, kind).reshape(self.shape)

    @classmethod
    def of(cls, x):
        """An Array of a NumPy array, whose type must be one of a stream's."""
        import numpy
        x = numpy.asarray(x)
        names = {"u1": "u8", "i4": "i32", "f2": "f16", "f4": "f32",
                 "f8": "f64"}
        kind = x.dtype.str[1:]
        _need(kind in names and x.ndim <= 4, "array of " + x.dtype.str)
        return cls(names[kind], x.shape,
                   x.astype("u1" if kind == "u1" else "<" + kind).tobytes())


class Record:
    def __init__(self, kind, frame=0, time=0.0, arrays=None):
        self.type, self.frame, self.time = kind, frame, time
        self.arrays = arrays or {}


# ---- XXH3-64, seed 0 ------------------------------------------------------

M32, M64 = (1 << 32) - 1, (1 << 64) - 1
P32 = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)
P64 = (0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9,
       0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5)
SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671f"
    "cb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c"
    "3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8"
    "a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364"
    "eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e"
    "2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")


def _u64(data, at):
    return int.from_bytes(data[at:at + 8], "little")


def _fold(a, b):
    p = a * b
    return (p & M64) ^ (p >> 64)


def _mix(data, at, secret):
    return _fold(_u64(data, at) ^ _u64(SECRET, secret),
                 _u64(data, at + 8) ^ _u64(SECRET, secret + 8))


def _avalanche(h):
    h &= M64
    h = (h ^ h >> 37) * 0x165667919E3779F9 & M64
    return h ^ h >> 32


STRIPE_KEYS = [struct.unpack_from("<8Q", SECRET, 8 * i) for i in range(16)]
LAST_KEY = struct.unpack_from("<8Q", SECRET, 121)
SCRAMBLE_KEY = struct.unpack_from("<8Q", SECRET, 128)


def _stripe(acc, words, key):
    for i in range(8):
        k = words[i] ^ key[i]
        acc[i ^ 1] += words[i]
        acc[i] = acc[i] + (k & M32) * (k >> 32) & M64


def xxh3_64(data):
    """Lengths that occur in streams: 0, 48 and multiples of 64."""
    n = len(data)
    if n == 0:
        h = _u64(SECRET, 56) ^ _u64(SECRET, 64)
        h = (h ^ h >> 33) * P64[1] & M64
        h = (h ^ h >> 29) * P64[2] & M64
        return h ^ h >> 32
    if n < 17 or n > 128 and n % 64:
        raise ValueError("no stream has a part of this length")
    acc = n * P64[0]
    if n <= 128:
        for i in reversed(range((n - 1) // 32 + 1)):
            acc += _mix(data, 16 * i, 32 * i)
            acc += _mix(data, n - 16 * (i + 1), 32 * i + 16)
        return _avalanche(acc)
    if n <= 240:
        for i in range(8):
            acc += _mix(data, 16 * i, 16 * i)
        acc = _avalanche(acc)
        for i in range(8, n // 16):
            acc += _mix(data, 16 * i, 16 * (i - 8) + 3)
        return _avalanche(acc + _mix(data, n - 16, 119))
    return _long(data, n)


def _long(data, n):
    acc = [P32[2], P64[0], P64[1], P64[2], P64[3], P32[1], P64[4], P32[0]]
    stripes = list(struct.iter_unpack("<8Q", data))
    for i, words in enumerate(stripes[:-1]):
        _stripe(acc, words, STRIPE_KEYS[i % 16])
        if i % 16 == 15:
            for k in range(8):
                a = acc[k] & M64
                acc[k] = (a ^ a >> 47 ^ SCRAMBLE_KEY[k]) * P32[0] & M64
    _stripe(acc, stripes[-1], LAST_KEY)
    h = n * P64[0]
    for i in range(4):
        h += _fold(acc[2 * i] & M64 ^ _u64(SECRET, 11 + 16 * i),
                   acc[2 * i + 1] & M64 ^ _u64(SECRET, 19 + 16 * i))
    return _avalanche(h)


# ---- reading ----------------------------------------------------------------

def _need(ok, text):
    if not ok:
        raise StreamError(text)


def _printable(b, space):
    return all((32 if space else 33) <= c < 127 for c in b)


def _arrays(payload, count):
    arrays, at = {}, 64 * count
    for i in range(count):
        name, dtype, ndim, *rest = ENTRY.unpack_from(payload, 64 * i)
        dims, (offset, size) = rest[:4], rest[4:]
        text = name.rstrip(b"\0")
        _need(0 < len(text) < 24 and _printable(text, False), "array name")
        key = text.decode()
        _need(key not in arrays, "two arrays " + key)
        _need(dtype < 5 and ndim <= 4, key + ": dtype or dimensions")
        _need(not any(dims[ndim:]), key + ": unused dimensions")
        _need(offset == at, key + ": offset")
        _need(size == math.prod(dims[:ndim]) * DTYPES[dtype][2] and
              at + size <= len(payload), key + ": size")
        arrays[key] = Array(DTYPES[dtype][0], dims[:ndim],
                            payload[at:at + size])
        at += size + -size % 64
        _need(not any(payload[offset + size:at]), key + ": padding")
    _need(at == len(payload), "payload size")
    return arrays


def read_stream(f, max_bytes=MAX_BYTES):
    """Yield every Record before END; StreamError when something is wrong."""
    records = 0
    while True:
        head = f.read(64)
        _need(len(head) == 64, "no END record")
        (magic, version, size, kind, count, frame, time, length, digest,
         check, zero) = HEADER.unpack(head)
        _need(magic == b"SPID", "magic")
        _need(check == xxh3_64(head[:48]), "header checksum")
        _need(version == 1 and size == 64 and zero == 0, "version")
        _need(_printable(kind, True) and kind[:1] != b" ", "record type")
        _need(math.isfinite(time), "time")
        _need(count <= 64 and length <= max_bytes and length % 64 == 0 and
              64 * count <= length, "sizes")
        payload = f.read(length)
        _need(len(payload) == length, "cut short")
        _need(digest == xxh3_64(payload), "payload checksum")
        arrays = _arrays(payload, count)
        if kind == b"END ":
            _need(not length and frame == records, "END")
            _need(not f.read(1), "data after END")
            return
        records += 1
        yield Record(kind.decode(), frame, time, arrays)


# ---- writing ----------------------------------------------------------------

class Writer:
    def __init__(self, f):
        self.f, self.records = f, 0

    def write(self, rec):
        table, data = b"", b""
        at = 64 * len(rec.arrays)
        for name, a in rec.arrays.items():
            code = [d[0] for d in DTYPES].index(a.dtype)
            dims = list(a.shape) + [0] * (4 - len(a.shape))
            table += ENTRY.pack(name.encode(), code, len(a.shape), *dims,
                                at + len(data), len(a.data))
            data += a.data + bytes(-len(a.data) % 64)
        payload = table + data
        head = HEADER.pack(b"SPID", 1, 64, rec.type.encode(),
                           len(rec.arrays), rec.frame, rec.time,
                           len(payload), xxh3_64(payload), 0, 0)
        self.f.write(head[:48] + struct.pack("<QQ", xxh3_64(head[:48]), 0))
        self.f.write(payload)
        self.records += 1

    def end(self):
        self.write(Record("END ", self.records))
        self.f.flush()


# ---- as a program -----------------------------------------------------------

def describe(rec):
    rows = []
    for name, a in rec.arrays.items():
        values = a.values()
        good = [v for v in values if math.isfinite(v)]
        rows.append({
            "name": name, "dtype": a.dtype, "shape": list(a.shape),
            "min": min(good) if good else None,
            "mean": math.fsum(good) / len(good) if good else None,
            "max": max(good) if good else None,
            "nonfinite": len(values) - len(good)})
    return {"type": rec.type, "frame": rec.frame, "time": rec.time,
            "arrays": rows}


def main():
    copy = sys.argv[1:] == ["--copy"]
    out = Writer(sys.stdout.buffer)
    good = 0
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        for rec in read_stream(sys.stdin.buffer):
            good += 1
            if copy:
                out.write(rec)
            else:
                print(json.dumps(describe(rec)))
    except StreamError as e:
        sys.exit("spidstream.py: <stdin>: after record %d: %s"
                 % (good, e))
    if copy:
        out.end()


if __name__ == "__main__":
    main()
