# spid-prepare: plain clips to training records; a model on another head.
load helper
load animate

prepare() { animate_files; }

run_prepare() {
    spid-prepare -m model --frames 3 --least 2 --min-face 20 "$@"
}

@test "clips become records that train, a bad one is listed, a second run does nothing" {
    mkdir clips
    cp drive.y4m clips/one.y4m
    spid-synth -q -n 1 --frames 3 -s 8 --size 192 --head "$HEAD" -o clips/two.y4m
    echo 'no video' >clips/three.mp4
    status 0 run_prepare -o records clips
    has 'three.mp4: '
    has '3 clips: 2 made, 0 were there, 1 bad'
    [ "$(ls records/*.spid | wc -l)" -eq 2 ]
    [ "$(ls records/*.bad | wc -l)" -eq 1 ]
    [ "$(wc -l <records/clips.tsv)" -eq 3 ]
    # one shape, then a motion with landmarks and a picture with its mask
    spid-dump records/two-*.spid >two
    [ "$(grep -c '^SHAP' two)" -eq 1 ]
    [ "$(grep -c '^MOTN' two)" -eq 3 ]
    [ "$(grep -c '^IMAG' two)" -eq 3 ]
    grep -q '  lmk ' two
    grep -q '  mask ' two
    status 0 run_prepare -o records clips
    has '3 clips: 0 made, 3 were there, 0 bad'
    [ "$(wc -l <records/clips.tsv)" -eq 3 ]
    # in parts, the same bytes
    run_prepare -q -o parts --part 1/2 clips
    run_prepare -q -o parts --part 2/2 clips 2>/dev/null || true
    for f in records/*.spid; do cmp "$f" "parts/${f##*/}"; done
    # the whole system learns from them: anchors are these motions
    cat >all.json <<'J'
{"stage": "all", "steps": 2, "log_every": 1, "rate": 1e-3, "batch": 1, "micro": 1, "pool": 2, "image": 128, "targets": 1,
 "loss": {"anchor_start": 1, "anchor_end": 0.1, "anchor_steps": 2},
 "model": {"size": 128, "plane": 16, "mouth": 4, "channels": 8, "feature": 8,
  "motion": {"net": "mobilenetv3_small_100"}, "shape": {"net": "mobilenetv3_small_100"},
  "backbone": {"type": "small", "width": 4}, "init": {"width": 8}, "static": {"width": 8},
  "dynamic": {"width": 8, "head": 8, "vertex": 8}, "mouth_decoder": {"width": 8},
  "rgb_skip": true, "refiner": {"type": "narrow", "width": 16}}}
J
    spid-train -q -c all.json -o run --head "$HEAD" records
    [ "$(wc -l <run/log.tsv)" -eq 3 ]
    # and E_m with it
    need_numpy
    spid-train -q -c all.json -o still --steps 1 --head "$HEAD" records
    PYTHONPATH=$BATS_TEST_DIRNAME "$PYTHON" - <<'P'
import numpy as np, import_read
a, b = (import_read.load(d + "/model.safetensors")[0]["motion.exp.weight"] for d in ("still", "run"))
assert np.abs(a - b).max() > 1e-5, np.abs(a - b).max()
P
}

@test "prepare: what cannot be is one line" {
    status 64 spid-prepare -m model drive.y4m
    has 'expected -o DIR'
    status 64 spid-prepare -m model -o records
    status 64 run_prepare -o records --part 3/2 drive.y4m
    has '--part=3/2: not a part (expected I/N, I from 1 to N)'
    status 66 run_prepare -o records @missing
    has 'missing: No such file'
    echo nothing >x.mp4
    status 65 run_prepare -q -o records x.mp4
    [ ! -e records/x-*.spid ] && [ ! -e records/x-*.part ]
    grep -q 'x.mp4' records/x-*.bad
}

@test "a model moved to another head: the same faces, another basis" {
    need_numpy
    export PYTHONPATH=$BATS_TEST_DIRNAME
    local model=$PWD/made.safetensors
    spid-head -q -o sculpted.safetensors            # its arrays are not packed
    HEAD=$PWD/sculpted.safetensors
    "$TOP/${BUILD:-build}/tests/unit/avatar_model" "$model" small "$HEAD"
    # the same head, its vertices in another order, expressions mixed by a
    # rotation, the origin elsewhere
    "$PYTHON" - "$HEAD" <<'P'
import json, struct, sys
import numpy as np, import_read
r, meta = import_read.load(sys.argv[1])
rng = np.random.default_rng(2)
V = len(r["v_template"])
p = rng.permutation(V); back = np.argsort(p)
n = int(meta.get("nshape", 300))
q = np.linalg.qr(rng.normal(size=(100, 100)))[0]
out = {}
for k, x in r.items():
    if k == "shapedirs":
        x = x.astype("f8")[p].copy(); x[:, :, n:] = x[:, :, n:] @ q
    elif k in ("v_template", "posedirs", "weights", "l_eyelid", "r_eyelid"): x = x[p]
    elif k in ("region", "hair", "uv"): continue
    elif k == "J_regressor": x = x[:, p]
    elif k in ("f", "lip_inner", "lip_upper_outer"): x = back[x].astype("i4")
    if k == "v_template": x = x + np.array([0, .02, .01], "f4")
    out[k] = np.ascontiguousarray(x.astype("i4" if x.dtype.kind == "i" else "f4"))
head, at = {"__metadata__": {k: v for k, v in meta.items() if k in ("scale", "nshape")}}, 0
for k, x in out.items():
    head[k] = {"dtype": "I32" if x.dtype.kind == "i" else "F32", "shape": x.shape, "data_offsets": [at, at + x.nbytes]}
    at += x.nbytes
t = json.dumps(head).encode(); t += b" " * (-len(t) % 8)
open("other.safetensors", "wb").write(struct.pack("<Q", len(t)) + t + b"".join(x.tobytes() for x in out.values()))
P
    status 0 spid-import "$model" --as model --from-head "$HEAD" \
        --head other.safetensors -o moved.safetensors
    has 'leave'
    for k in a b; do
        [ $k = a ] && M=$model H=$HEAD || M=moved.safetensors H=other.safetensors
        spid-shape -q -m "$M" --head "$H" source.png -o $k.id
        spid-flame --head "$H" -i $k.id $k.id -o $k.mesh
        spid-dump --npy $k $k.mesh
    done
    "$PYTHON" - "$HEAD" <<'P'
import sys, numpy as np, import_read
lmk = []
for k, h in (("a", sys.argv[1]), ("b", "other.safetensors")):
    r, _ = import_read.load(h)
    v, c = np.load(k + "/MESH.verts.npy")[0], np.load(k + "/MESH.cam.npy")[0]
    x = np.einsum("lk,lkc->lc", r["landmark_bary"], v[r["f"][r["landmark_faces"]]]) @ c[:, :3].T + c[:, 3]
    lmk.append(x[:, :2] / x[:, 2:] * 12 * 256 + 256)
d = np.linalg.norm(lmk[0] - lmk[1], axis=1)
print(d.mean(), d.max())
assert d.mean() < 6, d
P
    # the whole of it runs on the other head
    spid-animate -q -m moved.safetensors --head other.safetensors source.png drive.y4m -o x.y4m
    status 64 spid-import "$model" --as model --head other.safetensors -o x.safetensors
    has 'expected the model'
    one_line
    [ ! -e x.safetensors ]
}
