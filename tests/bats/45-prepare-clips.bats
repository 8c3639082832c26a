# spid-prepare: plain clips to training records; a model on another head.
load helper
load animate

prepare() { animate_files; }

run_prepare() {
    spid-prepare -m model --frames 3 --least 2 --min-face 20 "$@"
}

@test "clips become records that train, a bad one is listed, a second run does nothing" {
    three_clips
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

# Three clips, of which one is no video.
three_clips() {
    mkdir clips
    cp drive.y4m clips/one.y4m
    echo 'no video' >clips/three.mp4
    spid-synth -q -n 1 --frames 3 -s 8 --size 192 --head "$HEAD" -o clips/two.y4m
}

# same_records A B: the same streams and reasons in two folders.
same_records() {
    local f
    [ "$(cd "$1" && ls *.spid *.bad)" = "$(cd "$2" && ls *.spid *.bad)" ]
    for f in "$1"/*.spid; do cmp "$f" "$2/${f##*/}"; done
    cmp <(sort "$1/clips.tsv") <(sort "$2/clips.tsv")
}

@test "prepare in parallel, by each recipe of the manual, is prepare in one" {
    three_clips
    run_prepare -q -o one clips 2>/dev/null
    # each part alone, both at once
    seq 2 | xargs -P 2 -I{} spid-prepare -q -j 1 -m model --frames 3 --least 2 \
        --min-face 20 --part {}/2 -o xargs clips 2>/dev/null || [ $? = 123 ]
    same_records one xargs
    if command -v parallel >/dev/null && parallel --version 2>/dev/null | grep -q GNU; then
        seq 2 | parallel spid-prepare -q -j 1 -m model --frames 3 --least 2 \
            --min-face 20 --part {}/2 -o gnu clips 2>/dev/null || true
        same_records one gnu
    fi
    if command -v mpirun >/dev/null; then
        mpirun --allow-run-as-root --oversubscribe -n 2 sh -c 'spid-prepare -q -j 1 -m model --frames 3 \
            --least 2 --min-face 20 --part $((OMPI_COMM_WORLD_RANK + 1))/$OMPI_COMM_WORLD_SIZE -o mpi clips || :' 2>/dev/null
        same_records one mpi
    fi
}

@test "prepare that was killed goes on where it was" {
    three_clips
    run_prepare -q -o whole clips 2>/dev/null
    spid-prepare -q -m model --frames 3 --least 2 --min-face 20 -o cut clips 2>/dev/null &
    local pid=$! i
    for ((i = 0; i < 600; i++)); do
        compgen -G 'cut/*.spid' >/dev/null && break
        sleep 0.05
    done
    kill -9 "$pid" || true
    wait "$pid" || true
    # as if it had been in the midst of the last one
    rm -f cut/two-*
    sed -i '/two\.y4m/d' cut/clips.tsv
    head -c 1000 whole/two-*.spid >"cut/$(basename whole/two-*.spid).part"
    stat -c %Y%i cut/one-*.spid >before
    status 0 run_prepare -o cut clips
    has '3 clips: '
    stat -c %Y%i cut/one-*.spid | cmp - before
    same_records whole cut
    [ -z "$(find cut -name '*.part')" ]
    # or between a clip's line and its records, or its reason
    rm cut/two-*.spid cut/three-*.bad
    run_prepare -q -o cut clips 2>/dev/null
    same_records whole cut
}

@test "spid-train makes records of plain clips itself, once, and learns from their pictures alone" {
    local model=$TOP/examples/model/model.safetensors
    need_numpy
    spid-synth -q -n 1 --frames 6 -s 8 --size 256 --head "$HEAD" -o clip.y4m
    echo nothing >bad.mp4
    printf '# clips\nclip.y4m\nbad.mp4\n' >list
    cat >all.json <<'J'
{"stage": "all", "steps": 160, "log_every": 1, "rate": 1e-3, "batch": 1, "micro": 1, "pool": 1, "image": 128, "targets": 1,
 "validation_every": 20, "validation_people": 1,
 "loss": {"anchor_start": 1, "anchor_end": 0.1, "anchor_steps": 120},
 "model": {"size": 128, "plane": 32, "mouth": 4, "channels": 8, "feature": 8,
  "motion": {"net": "mobilenetv3_small_150"}, "shape": {"net": "mobilenetv3_small_100"},
  "backbone": {"type": "small", "width": 4}, "init": {"width": 8}, "static": {"width": 8},
  "dynamic": {"width": 8, "head": 8, "vertex": 8}, "mouth_decoder": {"width": 8},
  "rgb_skip": true, "refiner": {"type": "narrow", "width": 16}}}
J
    train() { spid-train -c all.json --head "$HEAD" --frames 5 -m "$model" "$@"; }
    status 0 train -o none --steps 0 --records records --init "$model:motion." @list
    has 'bad.mp4: not a video'
    has '2 clips: 1 made, 0 were there, 1 bad'
    [ "$(find records -name 'clip-*.spid' | wc -l)" -eq 1 ]
    status 0 train -o run --records records --validation records/clip-*.spid \
        --init "$model:motion." @list
    has '2 clips: 0 made, 2 were there, 0 bad'
    has 's a step ('
    # 160 steps of source and target frames: nearer to the clip, by an encoder
    # that has moved, for the anchors fade
    awk -F'\t' 'NR == 2 {a = $2} {b = $2} END {print a, b; exit b > a + 1 ? 0 : 1}' run/held.tsv
    PYTHONPATH=$BATS_TEST_DIRNAME "$PYTHON" - "$model" <<'P'
import sys, numpy as np, import_read
a, b = (import_read.load(f)[0]["motion.exp.weight"].astype("f4") for f in (sys.argv[1], "run/model.safetensors"))
assert np.abs(a - b).max() > 1e-4, np.abs(a - b).max()
P
    # a folder of clips is prepared as its list was; a folder of records is read
    mkdir folder
    cp clip.y4m folder
    train -q -o inside --steps 1 folder
    [ "$(find inside/records -name '*.spid' | wc -l)" -eq 1 ]
    train -q -o again --steps 1 records
    [ ! -e again/records ]
    # nothing but bad clips is an error
    status 66 train -q -o empty --steps 1 bad.mp4
    has 'empty/records: no streams'
    mkdir nothing
    status 66 train -q -o empty --steps 1 nothing
    has 'nothing: an empty folder (expected clips)'
    status 66 train -q -o empty --steps 1 @missing
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
    [ ! -e records/x-*.spid ]
    [ ! -e records/x-*.part ]
    grep -q 'x.mp4' records/x-*.bad
}

@test "a model moved to another head: the same faces, another basis" {
    need_numpy
    export PYTHONPATH=$BATS_TEST_DIRNAME
    local model=$PWD/made.safetensors
    spid-head -q -o plain.safetensors
    HEAD=$PWD/plain.safetensors
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
        spid-dump --npy $k --only SRCI $k.id
    done
    "$PYTHON" - "$HEAD" <<'P'
import sys, numpy as np, import_read
lmk = []
for k, h in (("a", sys.argv[1]), ("b", "other.safetensors")):
    r, _ = import_read.load(h)
    v, c = np.load(k + "/MESH.verts.npy")[0], np.load(k + "/MESH.cam.npy")[0]
    x = np.einsum("lk,lkc->lc", r["landmark_bary"], v[r["f"][r["landmark_faces"]]]) @ c[:, :3].T + c[:, 3]
    # in the picture: each head's window is about its own origin
    w = np.load(k + "/SRCI.crop.npy")[0]
    lmk.append(w[:2] + x[:, :2] / x[:, 2:] * 6 * w[2])
d = np.linalg.norm(lmk[0] - lmk[1], axis=1) * 512 / w[2]
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

@test "an imported FLAME runs the whole of it: one process and the pipe give the same bytes" {
    need_numpy
    load flame
    export PYTHONPATH=$BATS_TEST_DIRNAME
    local own=$HEAD
    HEAD=plain.safetensors
    spid-head -q -o "$HEAD"
    flame_files
    # lids and rings of the lips by the landmarks
    spid-import -q flame.pkl --as flame --landmarks landmarks.npy -o flame.safetensors
    spid-import -q model/model.safetensors --as model --from-head "$own" \
        --head flame.safetensors -o moved.safetensors
    spid-shape -q -m moved.safetensors --head flame.safetensors source.png -o me.g
    spid-branches -q -m moved.safetensors --head flame.safetensors --bake me.g -o avatar.g
    spid-animate -q --absolute -b black -m moved.safetensors --head flame.safetensors \
        source.png drive.y4m -o one.y4m
    set -o pipefail
    spid-motion -q -m moved.safetensors --head flame.safetensors drive.y4m |
        spid-flame --head flame.safetensors -i avatar.g | spid-branches -i avatar.g |
        spid-splat -q --size 128 --channels 8 |
        spid-refine -q -m moved.safetensors -o pipe.y4m
    cmp one.y4m pipe.y4m
}
