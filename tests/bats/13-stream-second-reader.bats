load helper

prepare() {
    motion 3
    cat >odd.json <<'J'
{"type":"ABCD","frame":7,"time":1e-3,"arrays":[
 {"name":"a","dtype":"u8","shape":[2,2],"data":[0,255,7,1]},
 {"name":"b","dtype":"i32","shape":[3],"data":[-2147483648,0,2147483647]},
 {"name":"c","dtype":"f16","shape":[3],"data":[0.5,"inf",6e-8]},
 {"name":"d","dtype":"f32","shape":[3],"data":[1e-45,"nan",0.1]},
 {"name":"e","dtype":"f64","shape":[],"data":[0.1]},
 {"name":"none","dtype":"f32","shape":[0,3],"data":[]}]}
J
    spid-pack odd.json motion.spid -o all.spid
    second=$TOP/examples/spidstream.py
}

@test "a reader written from the page alone reads the same" {
    spid-dump --json all.spid >first.json
    python3 "$second" <all.spid >second.json
    python3 - <<'P'
import json
a, b = ([json.loads(s) for s in open(n + ".json")]
        for n in ("first", "second"))
assert len(a) == len(b) == 6, (len(a), len(b))
for x, y in zip(a, b):
    for k in ("type", "frame", "time"):
        assert x[k] == y[k], (x[k], y[k])
    assert len(x["arrays"]) == len(y["arrays"])
    for p, q in zip(x["arrays"], y["arrays"]):
        for k in ("name", "dtype", "shape", "nonfinite"):
            assert p[k] == q[k], (p, q)
        for k in ("min", "mean", "max"):
            same = p[k] == q[k] or abs(p[k] - q[k]) <= 1e-8 * abs(q[k])
            assert same, (k, p, q)
P
}

@test "its writer makes the same bytes, for every length of hash" {
    python3 "$second" --copy <all.spid | cmp - all.spid
    python3 -B - "$TOP/examples" <<'P' >lengths.spid
import sys
sys.path.insert(0, sys.argv[1])
import spidstream
out = spidstream.Writer(sys.stdout.buffer)
for n in (0, 1, 64, 65, 128, 129, 192, 193, 256, 1000, 1024, 1025, 5000):
    a = spidstream.Array("u8", [n], bytes(range(256)) * 20)
    a.data = a.data[:n]
    out.write(spidstream.Record("TEST", n, 0.5, {"x": a}))
out.end()
P
    status 0 spid-dump -c lengths.spid
    has '13 records'
}

@test "both refuse the same damage" {
    python3 -B - "$TOP/examples" <<'P'
import io, subprocess, sys
sys.path.insert(0, sys.argv[1])
import spidstream
data = open("all.spid", "rb").read()
places = (0, 5, 9, 13, 40, 50, 60, 64, 100, 130, 500, 700, len(data) - 50)
for at in places:
    flipped = bytearray(data)
    flipped[at] ^= 0x10
    for bad in (bytes(flipped), data[:at]):
        first = subprocess.run(["spid-dump"], input=bad, capture_output=True)
        assert first.returncode == 65, (at, first)
        try:
            list(spidstream.read_stream(io.BytesIO(bad)))
        except spidstream.StreamError:
            continue
        raise SystemExit("offset %d: only the C reader saw it" % at)
P
}

@test "the filter at the end of spid-stream(5) compiles, runs and filters" {
    mandoc -T ascii -O width=200 "$TOP/man/spid-stream.5" | col -b |
        sed -n '/calm: halve the jaw/,/^[A-Z]/p' | grep -v '^SEE' >calm.c
    ${CC:-cc} -Wall -Wextra -Werror -o calm calm.c -lxxhash
    ./calm <motion.spid >calm.spid
    status 0 spid-dump -cq calm.spid
    spid-dump --json --values --frames 2 calm.spid >calm.json
    grep -q '"data":\[0.00999999978,0,0\]' calm.json
    spid-dump --only CONF --json --values calm.spid >a
    spid-dump --only CONF --json --values motion.spid >b
    cmp a b
    head -c 500 motion.spid >cut.spid
    run ./calm <cut.spid
    [ "$status" -eq 65 ]
}

@test "its arrays are NumPy's, there and back" {
    need_numpy
    cat >stage.py <<'P'
import sys
sys.path.insert(0, sys.argv[1])
import numpy
from spidstream import Array, Writer, read_stream
out = Writer(sys.stdout.buffer)
for rec in read_stream(sys.stdin.buffer):
    for name, a in rec.arrays.items():
        x = a.numpy()
        assert x.shape == a.shape and tuple(x.reshape(-1)[:2]) == a.values()[:2] \
            or numpy.isnan(x).any(), name
        rec.arrays[name] = Array.of(x)
    if rec.type == "MOTN":
        rec.arrays["jaw"] = Array.of(2 * rec.arrays["jaw"].numpy())
    out.write(rec)
out.end()
P
    "$PYTHON" stage.py "$TOP/examples" <all.spid >twice.spid
    spid-dump --only ABCD all.spid --json --values >a
    spid-dump --only ABCD twice.spid --json --values | cmp a -
    spid-dump --only MOTN --frames 2:3 --json --values twice.spid | grep -q '"data":\[0.0399999'
}
