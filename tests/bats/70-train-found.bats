# What a refiner learns from: people as the programs find them, and half of what it
# has learned.
load helper

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    spid-synth -q -n 2 --frames 2 --size 512 --effects 0 --turn 25,-10 \
        --without mesh -o people.spid
}

@test "found.py: the found shape and motions beside the true pictures" {
    need_numpy
    cd "$BATS_FILE_TMPDIR"
    "$PYTHON" -B "$TOP/examples/found.py" found.spid people.spid
    spid-dump --check found.spid
    "$PYTHON" -B - "$TOP" <<'EOF'
import sys
sys.path.insert(0, sys.argv[1] + "/examples")
import numpy as np
from spidstream import read_stream

def read(path):
    with open(path, "rb") as f:
        return [r for r in read_stream(f) if r.type in ("SHAP", "MOTN", "IMAG")]

true, found = read("people.spid"), read("found.spid")
assert [r.type for r in found] == 2 * ["SHAP", "MOTN", "IMAG", "MOTN", "IMAG"]
shapes = [[r.arrays["shape"].numpy() for r in s if r.type == "SHAP"]
          for s in (true, found)]
for a, b in zip(*shapes):
    assert 0.01 < np.abs(a - b).max()
motions = [[r.arrays for r in s if r.type == "MOTN"] for s in (true, found)]
for a, b in zip(*motions):
    cosine = (np.trace(a["rot"].numpy().T @ b["rot"].numpy()) - 1) / 2
    assert cosine > np.cos(np.radians(12)), cosine
    assert b["light"].shape == (3,) and b["lmk"].shape == (68, 2)
for r in found:
    if r.type == "IMAG":        # cut alike: the person over black is the person
        whole = r.arrays["mask"].numpy() == 255
        rgb, alone = (r.arrays[k].numpy()[whole].astype(int)
                      for k in ("rgb", "alone"))
        assert whole.any() and np.abs(rgb - alone).mean() < 3
EOF
}

@test "found.py: whom the programs do not find is named and left out" {
    need_numpy
    cd "$BATS_FILE_TMPDIR"
    spid-dump -q --npy true -o /dev/null people.spid
    "$PYTHON" -B - <<'EOF'
import numpy as np
np.save("mask.npy", np.load("true/IMAG.mask.npy")[0])
np.save("rgb.npy", np.zeros((512, 512, 3), np.uint8))
EOF
    spid-dump -q --json --values people.spid |
        grep -E '"type":"(SHAP|MOTN)"' | head -n 2 >one.json
    spid-pack -q -t IMAG one.json rgb=rgb.npy mask=mask.npy -o dark.spid
    run "$PYTHON" -B "$TOP/examples/found.py" out.spid dark.spid
    [ "$status" -ne 0 ]
    has "person 1"
    [ ! -e out.spid ]
}

@test "mean.py: half the way between two models, of what is asked for alone" {
    need_numpy
    cd "$BATS_FILE_TMPDIR"
    "$PYTHON" -B - "$TOP/examples/model/model.safetensors" <<'EOF'
import json, struct, sys
b = bytearray(open(sys.argv[1], "rb").read())
n, = struct.unpack("<Q", b[:8])
head = json.loads(b[8:8 + n])
at = head["refine.rgb.weight"]["data_offsets"]
b[8 + n + at[0]:8 + n + at[1]] = bytes(at[1] - at[0])
open("zero.safetensors", "wb").write(b)
EOF
    "$PYTHON" -B "$TOP/examples/mean.py" half.safetensors zero.safetensors \
        "$TOP/examples/model/model.safetensors" refine.
    "$PYTHON" -B - "$TOP" <<'EOF'
import sys
sys.path.insert(0, sys.argv[1] + "/examples")
import numpy as np
from mean import weights
half = weights("half.safetensors", "")
model = weights(sys.argv[1] + "/examples/model/model.safetensors", "")
assert half and all(name.startswith("refine.") for name in half)
for name, t in half.items():
    by = 0.5 if name == "refine.rgb.weight" else 1
    assert np.array_equal(t, by * model[name]), name
assert np.abs(half["refine.rgb.weight"]).max() > 0
EOF
    run "$PYTHON" -B "$TOP/examples/mean.py" none.safetensors zero.safetensors \
        zero.safetensors nothing.
    [ "$status" -ne 0 ]
    [ ! -e none.safetensors ]
}
