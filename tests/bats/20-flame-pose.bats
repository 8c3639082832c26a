# spid-flame: what posing does to a stream.
load helper

prepare() {
    HEAD=$TOP/${BUILD:-build}/share/spid/head.safetensors
    [ -e "$HEAD" ] || skip "no head model built (make)"
    motion 3
}

@test "motion packed from JSON becomes a moving head" {
    spid-flame --head "$HEAD" motion.spid -o mesh.spid
    spid-dump --check mesh.spid
    spid-dump --json --only MESH mesh.spid >mesh.json
    [ "$(wc -l <mesh.json)" -eq 3 ]
    # the jaw opens: the lips come apart, frame by frame
    spid-dump --npy d mesh.spid
    need_numpy
    "$PYTHON" - <<'PY'
import numpy as np
gap = np.load("d/MESH.gap.npy").ravel()
verts = np.load("d/MESH.verts.npy")
assert (np.diff(gap) > 0).all(), gap
assert np.abs(verts[1] - verts[0]).max() > 1e-4
PY
}

@test "the first mesh alone brings the faces" {
    spid-flame --head "$HEAD" motion.spid -o mesh.spid
    run bash -c 'spid-dump mesh.spid | grep -c "faces "'
    [ "$output" = 1 ]
}

@test "unknown records and arrays pass through, motion on request" {
    spid-flame --head "$HEAD" --keep-motion motion.spid -o both.spid
    run bash -c 'spid-dump both.spid | grep -c "^MOTN"'
    [ "$output" = 3 ]
}

@test "an expression of another length is named" {
    sed 's/"exp":\[0,/"exp":[0,0,/' motion-src.json >long.json
    spid-pack long.json -o long.spid
    status 65 spid-flame --head "$HEAD" long.spid -o out.spid
    one_line
    has "exp"
    [ ! -e out.spid ]
}

@test "a stream cut short leaves no finished output" {
    head -c 3000 motion.spid >cut.spid
    status 65 spid-flame --head "$HEAD" cut.spid -o out.spid
    [ ! -e out.spid ]
}

@test "weights that do not sum to 1 are refused by array and index" {
    need_numpy
    "$PYTHON" - "$HEAD" <<'PY'
import json, struct, sys
b = bytearray(open(sys.argv[1], "rb").read())
n = struct.unpack("<Q", b[:8])[0]
h = json.loads(b[8:8 + n])
at = 8 + n + h["weights"]["data_offsets"][0] + 4 * 5 * 7
b[at:at + 4] = struct.pack("<f", 3.0)
open("bad.safetensors", "wb").write(b)
PY
    status 65 spid-flame --head bad.safetensors motion.spid -o out.spid
    one_line
    has "weights[7]"
}

# peak COMMAND...: its largest resident memory, in kB.
peak() {
    "$PYTHON" - "$@" <<'PY'
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
PY
}

@test "10,000 frames in under 64 MB, and no more than 10 frames take" {
    [[ $BUILD != *sanitize* ]] || skip "a sanitizer's memory is not the program's (no SANITIZE)"
    need_numpy
    motion 10
    for _ in {1..1000}; do cat motion-src.json; done >long.json
    spid-pack long.json -o long.spid
    few=$(peak spid-flame --head "$HEAD" motion.spid -o few.spid)
    many=$(peak spid-flame --head "$HEAD" long.spid -o /dev/null)
    echo "10 frames $few kB, 10,000 frames $many kB"
    [ "$many" -lt 65536 ]
    # the mapped input counts as resident: a window of it, never all
    [ "$many" -lt $((few + 16384)) ]
}

@test "the same head in double precision poses the same, in under 64 MB" {
    need_numpy
    "$PYTHON" - "$HEAD" <<'PY'
import json, struct, sys
import numpy as np
b = open(sys.argv[1], "rb").read()
n = struct.unpack("<Q", b[:8])[0]
h, data, out = json.loads(b[8:8 + n]), b[8 + n:], b""
for k, t in h.items():
    if k == "__metadata__":
        continue
    raw = data[slice(*t["data_offsets"])]
    if t["dtype"] == "F32":
        raw, t["dtype"] = np.frombuffer(raw, "<f4").astype("<f8").tobytes(), "F64"
    t["data_offsets"] = [len(out), len(out) + len(raw)]
    out += raw
j = json.dumps(h).encode()
open("double.safetensors", "wb").write(struct.pack("<Q", len(j)) + j + out)
PY
    spid-flame --head "$HEAD" motion.spid -o a.spid
    spid-flame --head double.safetensors motion.spid -o b.spid
    cmp a.spid b.spid
    [[ $BUILD != *sanitize* ]] || return 0
    [ "$(peak spid-flame --head double.safetensors motion.spid -o b.spid)" -lt 65536 ]
}
