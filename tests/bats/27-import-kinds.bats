# spid-import --as: public names in, files that the toolkit loads out.
load helper
load flame

prepare() {
    export PYTHONPATH=$BATS_TEST_DIRNAME
    HEAD=$BATS_FILE_TMPDIR/plain.safetensors
    [ -e "$HEAD" ] || spid-head -q -o "$HEAD"
    need_numpy
}

@test "flame: every array of the head it was made from, and it poses the same" {
    flame_files
    spid-import flame.pkl --as flame --landmarks landmarks.npy \
        --eyelids l_eyelid.npy,r_eyelid.npy -o flame.safetensors
    "$PYTHON" - "$HEAD" <<'P'
import sys, numpy as np, import_read
want, _ = import_read.load(sys.argv[1])
got, meta = import_read.load("flame.safetensors")
for n, x in got.items():
    if n == "lip_inner":        # found by landmarks: at the corners a loop beside it
        v = want["v_template"]
        far = np.linalg.norm(v[x][:, None] - v[want[n]][None], axis=2).min(1)
        assert len(x) == len(want[n]) and far.max() < 6e-4 and (far > 0).sum() < 8, far
        continue
    if n.startswith("avatar."):         # FLAME has no regions
        continue
    assert x.dtype == want[n].dtype and np.array_equal(x, want[n]), n
assert set(want) - set(got) == {"region", "hair", "uv", "lid_vertices", "lid_sides", "lid_shapedirs"}, set(want) ^ set(got)
assert meta["kind"] == "flame" and meta["nshape"] == "300"
assert len([k for k in meta if k.endswith("xxh128")]) == 4
P
    motion 3
    for h in "$HEAD" flame.safetensors; do
        spid-flame --head "$h" motion.spid -o mesh.spid
        spid-dump --npy "${h##*/}.d" mesh.spid
    done
    cmp plain.safetensors.d/MESH.verts.npy flame.safetensors.d/MESH.verts.npy
}

@test "flame: of 2019, 2020 or 2023, whichever arrays are chumpy's or sparse" {
    local year
    flame_files
    "$PYTHON" - "$HEAD" <<'P'
import pickle, sys
import numpy as np, import_read
chumpy, sparse = import_read.classes()
r, _ = import_read.load(sys.argv[1])
tree = {n: r[n].astype("f8") for n in ("v_template", "shapedirs", "posedirs", "weights", "J_regressor")}
rest = {"f": r["f"].astype("u4"), "kintree_table": np.array([[2**32 - 1, 0, 1, 1, 1], range(5)], "u4")}
def write(year, protocol, wrapped, regressor):
    d = {n: chumpy(x) if n in wrapped else x for n, x in tree.items()}
    pickle.dump({**d, **rest, "J_regressor": regressor(tree["J_regressor"])}, open(year + ".pkl", "wb"), protocol=protocol)
write("2019", 0, ("v_template", "shapedirs", "posedirs", "weights"), sparse)
write("2020", 2, ("v_template", "shapedirs"), sparse)
write("2023", 4, (), lambda x: sparse(x, rows=True))
write("dense", 5, (), lambda x: x)
P
    for year in 2019 2020 2023 dense; do
        spid-import -q $year.pkl --as flame --landmarks landmarks.npy -o $year.safetensors
    done
    "$PYTHON" - "$HEAD" <<'P'
import sys, numpy as np, import_read
want, _ = import_read.load(sys.argv[1])
for year in "2019", "2020", "2023", "dense":
    got, meta = import_read.load(year + ".safetensors")
    assert meta["kind"] == "flame"
    for n in ("v_template", "f", "shapedirs", "posedirs", "weights", "J_regressor", "parents"):
        assert np.array_equal(got[n], want[n]), (year, n)
P
}

@test "flame: landmarks of two tables, lids made from the landmarks" {
    flame_files
    spid-import -q flame.pkl --as flame --landmarks parts.npy -o a.safetensors
    status 0 spid-import flame.pkl --as flame --landmarks landmarks.npy \
        -o b.safetensors
    has 'left over: J [5, 3]'
    has 'eyelids are made from the landmarks'
    "$PYTHON" - "$HEAD" <<'P'
import sys, numpy as np, import_read
r, _ = import_read.load(sys.argv[1])
a, b = (import_read.load(n)[0] for n in ("a.safetensors", "b.safetensors"))
for n in a:
    assert np.array_equal(a[n], b[n]), n
mesh = r["v_template"]
marks = lambda v: np.einsum("ij,ijk->ik", r["landmark_bary"], v[r["f"][r["landmark_faces"]]])
for lid, upper, lower in (("l_eyelid", (43, 44), (42, 47, 46, 45)), ("r_eyelid", (37, 38), (39, 40, 41, 36))):
    closed = marks(mesh + a[lid])
    edge = marks(mesh)[list(lower)]
    open_gap = np.linalg.norm(marks(mesh)[list(upper)] - edge[1:3], axis=1)
    assert (open_gap > 0.008).all(), open_gap
    # on the lower lid's edge, whose points lie millimetres apart
    for p in closed[list(upper)]:
        d = min(np.linalg.norm(p - (x + t * (y - x))) for x, y in zip(edge, edge[1:])
                for t in np.linspace(0, 1, 200))
        assert d < 0.0015, d
    moved = np.abs(a[lid]).max(1) > 1e-6
    assert 50 < moved.sum() < 600
    side = mesh[moved, 0] * (1 if lid[0] == "l" else -1)
    assert (side > 0).all()
    # the eyeballs stay
    assert (r["region"][moved] != 4).all()
    # like the scans' own
    assert (a[lid] * r[lid]).sum() > 0.8 * np.sqrt((a[lid] ** 2).sum() * (r[lid] ** 2).sum())
P
}

@test "flame: what is missing or does not fit is listed, and nothing written" {
    flame_files
    status 65 spid-import flame.pkl --as flame -o x.safetensors
    has 'missing: static_lmk_faces_idx (expected [51])'
    has 'landmarks are a file of their own'
    status 65 spid-import landmarks.npy --as flame -o x.safetensors
    has 'missing: v_template (expected [any, 3])'
    "$PYTHON" - <<'P'
import pickle, numpy as np, import_read
import_read.classes()
d = pickle.load(open("flame.pkl", "rb"))
for name, value in (("f", np.full((4, 3), 6000)), ("posedirs", np.zeros((5140, 3, 9))),
                    ("v_template", np.full((5140, 3), np.nan))):
    pickle.dump({**d, name: value}, open(name + ".pkl", "wb"), protocol=4)
np.save("far.npy", {"full_lmk_faces_idx": np.full((1, 68), 99999), "full_lmk_bary_coords": np.zeros((1, 68, 3))})
P
    status 65 spid-import f.pkl --as flame --landmarks landmarks.npy -o x.safetensors
    has "tensor 'f' at index 0 is 6000 (expected 0 to 5139)"
    one_line
    status 65 spid-import posedirs.pkl --as flame --landmarks landmarks.npy -o x.safetensors
    has 'wrong shape: posedirs [5140, 3, 9] (expected [5140, 3, 36])'
    status 65 spid-import v_template.pkl --as flame --landmarks landmarks.npy -o x.safetensors
    has "tensor 'v_template' is not finite at index 0"
    status 65 spid-import flame.pkl --as flame --landmarks far.npy -o x.safetensors
    has "tensor 'full_lmk_faces_idx' at index 0 is 99999 (expected 0 to 10087)"
    status 65 spid-import flame.pkl --as flame --landmarks landmarks.npy \
        --eyelids landmarks.npy -o x.safetensors
    has 'missing: l_eyelid (expected [5140, 3])'
    [ ! -e x.safetensors ] && [ ! -e x.safetensors.part ]
}

@test "smirk: its expression and shape encoders become a model that runs" {
    [ -e "$HEAD" ] || skip "no head model built (make)"
    # the names and shapes of the network from a model of the toolkit
    "$PYTHON" - >names.json <<'P'
import json
IR = [("0.0", 16, 16, 0), ("1.0", 16, 24, 64), ("1.1", 24, 24, 72), ("2.0", 24, 40, 72), ("2.1", 40, 40, 120), ("2.2", 40, 40, 120),
      ("3.0", 40, 80, 240), ("3.1", 80, 80, 200), ("3.2", 80, 80, 184), ("3.3", 80, 80, 184), ("4.0", 80, 112, 480), ("4.1", 112, 112, 672),
      ("5.0", 112, 160, 672), ("5.1", 160, 160, 960), ("5.2", 160, 160, 960)]
def net(p):
    out = {}
    def bn(n, c):
        for k in ("weight", "bias", "running_mean", "running_var"): out[f"{p}{n}.{k}"] = [c]
        out[f"{p}{n}.num_batches_tracked"] = []
    out[p + "conv_stem.weight"] = [16, 3, 3, 3]; bn("bn1", 16)
    for at, i, o, m in IR:
        b = f"blocks.{at}."
        if not m:
            out[p + b + "conv_dw.weight"] = [i, 1, 3, 3]; bn(b + "bn1", i)
            out[p + b + "conv_pw.weight"] = [o, i, 1, 1]; bn(b + "bn2", o)
            continue
        out[p + b + "conv_pw.weight"] = [m, i, 1, 1]; bn(b + "bn1", m)
        out[p + b + "conv_dw.weight"] = [m, 1, 3, 3]; bn(b + "bn2", m)
        out[p + b + "conv_pwl.weight"] = [o, m, 1, 1]; bn(b + "bn3", o)
    out[p + "blocks.6.0.conv.weight"] = [960, 160, 1, 1]; bn("blocks.6.0.bn1", 960)
    return out
S = "smirk_encoder."
names = {**net(S + "shape_encoder.encoder."), **net(S + "expression_encoder.encoder."),
         S + "shape_encoder.shape_layers.0.weight": [300, 960], S + "shape_encoder.shape_layers.0.bias": [300],
         S + "expression_encoder.expression_layers.0.weight": [55, 960], S + "expression_encoder.expression_layers.0.bias": [55],
         S + "pose_encoder.pose_cam_layers.0.weight": [6, 576], S + "pose_encoder.pose_cam_layers.0.bias": [6]}
print(json.dumps(names))
P
    random_npz smirk.npz <names.json
    status 0 spid-import smirk.npz --as smirk -o smirk.safetensors
    has 'left over: smirk_encoder.pose_encoder.pose_cam_layers.0.weight [6, 576]'
    has 'start untrained'
    "$PYTHON" - <<'P'
import json, numpy as np, import_read
z = np.load("smirk.npz")
got, meta = import_read.load("smirk.safetensors")
S = "smirk_encoder."
for a, b in (("motion.encoder.", S + "expression_encoder.encoder."), ("shape.encoder.", S + "shape_encoder.encoder.")):
    for n in got:
        if n.startswith(a): assert np.array_equal(got[n], z[b + n[len(a):]]), n
assert np.array_equal(got["shape.shape.weight"], z[S + "shape_encoder.shape_layers.0.weight"])
w, b = (z[S + "expression_encoder.expression_layers.0." + k] for k in ("weight", "bias"))
e = got["motion.exp.weight"]
assert np.array_equal(e[:50], w[:50]) and not e[50:].any()
assert np.array_equal(got["motion.jaw.weight"], w[52:]) and np.array_equal(got["motion.jaw.bias"], b[52:])
assert np.allclose(got["motion.lid.weight"], 4 * w[50:52]) and np.allclose(got["motion.lid.bias"], 4 * b[50:52] - 2)
assert not got["motion.rot.weight"].any() and np.array_equal(got["motion.rot.bias"], [1, 0, 0, 0, -1, 0])
c = json.loads(meta["spid"])
assert c["motion"]["net"] == c["shape"]["net"] == "tf_mobilenetv3_large_minimal_100"
P
    # and the programs load it
    "$PYTHON" -c 'import sys; sys.stdout.buffer.write(b"P6 96 96 255\n" + bytes(range(256)) * 108)' >x.ppm
    spid-motion -q -m smirk.safetensors --head "$HEAD" --crop 48,48,90 x.ppm -o motion.spid
    spid-dump --check motion.spid
}

@test "dinov2: ViT-S/14 under the backbone's names, with a prefix or without" {
    vit_names 384 teacher.backbone. >names.json
    random_npz dino.npz <names.json
    status 0 spid-import dino.npz --as dinov2 -o dino.safetensors
    [ -z "$output" ]
    "$PYTHON" - <<'P'
import json, numpy as np, import_read
z = np.load("dino.npz")
got, meta = import_read.load("dino.safetensors")
a, b = "backbone.dino_model.", "teacher.backbone."
assert sorted(b + n[len(a):] for n in got) == sorted(z.files)
assert all(np.array_equal(x, z[b + n[len(a):]]) for n, x in got.items())
assert json.loads(meta["backbone"]) == {"type": "dinov2", "embed": 384, "depth": 12, "heads": 6, "patch": 14, "image": 518}
np.savez("part.npz", **{n[len(b):]: z[n] for n in z.files if "blocks.7.ls1" not in n}, extra=np.zeros(3))
np.savez("wide.npz", cls_token=np.zeros((1, 1, 1024)))
P
    status 65 spid-import part.npz --as dinov2 -o x.safetensors
    has 'missing: blocks.7.ls1.gamma (expected [384])'
    has 'left over: extra [3]'
    has 'not a whole dinov2: 1 tensors are missing or have a wrong shape'
    status 65 spid-import wide.npz --as dinov2 -o x.safetensors
    has 'tokens of 1024 numbers (expected 384, vits14, or 768, vitb14)'
    [ ! -e x.safetensors ]
}

@test "lpips: AlexNet and its linear weights, which spid-eval takes" {
    cat >alex.json <<'J'
{"features.0.weight": [64, 3, 11, 11], "features.0.bias": [64], "features.3.weight": [192, 64, 5, 5], "features.3.bias": [192],
 "features.6.weight": [384, 192, 3, 3], "features.6.bias": [384], "features.8.weight": [256, 384, 3, 3], "features.8.bias": [256],
 "features.10.weight": [256, 256, 3, 3], "features.10.bias": [256], "classifier.6.bias": [1000]}
J
    echo '{"lin0.model.1.weight": [1, 64, 1, 1], "lin1.model.1.weight": [1, 192, 1, 1], "lin2.model.1.weight": [1, 384, 1, 1],
        "lin3.model.1.weight": [1, 256, 1, 1], "lin4.model.1.weight": [1, 256, 1, 1]}' | random_npz lin.npz
    random_npz alex.npz <alex.json
    status 0 spid-import alex.npz --as lpips --linear lin.npz -o lpips.safetensors
    has 'left over: classifier.6.bias [1000]'
    status 65 spid-import alex.npz --as lpips -o x.safetensors
    has 'missing: lin0.model.1.weight'
    # the LPIPS package's own names give the same file
    "$PYTHON" - <<'P'
import numpy as np
a, l = np.load("alex.npz"), np.load("lin.npz")
at = {"0": 1, "3": 2, "6": 3, "8": 4, "10": 5}
np.savez("whole.npz", **{"net.slice%d.%s.%s" % (at[n.split(".")[1]], *n.split(".")[1:]): a[n] for n in a.files if "features" in n}, **dict(l))
P
    spid-import whole.npz --as lpips -o whole.safetensors
    "$PYTHON" -c '
import import_read
import_read.check("whole.safetensors", import_read.load("lpips.safetensors")[0])'
    mkdir a b
    "$PYTHON" - <<'P'
import numpy as np
for d, s in (("a", 1), ("b", 2)):
    open(d + "/0.ppm", "wb").write(b"P6 64 64 255\n" + np.random.default_rng(s).integers(0, 255, 12288).astype("u1").tobytes())
P
    spid-eval -q -f tsv --lpips lpips.safetensors a b | grep -q lpips
}

@test "arcface: an iresnet through a DataParallel checkpoint, which spid-eval takes" {
    "$PYTHON" - >names.json <<'P'
import json
out = {}
def bn(n, c):
    for k in ("weight", "bias", "running_mean", "running_var"): out[n + "." + k] = [c]
    out[n + ".num_batches_tracked"] = []
out["conv1.weight"] = [8, 3, 3, 3]; bn("bn1", 8); out["prelu.weight"] = [8]
c = 8
for l, (o, k) in enumerate(((8, 2), (16, 1), (24, 3), (40, 2)), 1):
    for i in range(k):
        b = f"layer{l}.{i}."
        bn(b + "bn1", c); out[b + "conv1.weight"] = [o, c, 3, 3]; bn(b + "bn2", o); out[b + "prelu.weight"] = [o]
        out[b + "conv2.weight"] = [o, o, 3, 3]; bn(b + "bn3", o)
        if i == 0: out[b + "downsample.0.weight"] = [o, c, 1, 1]; bn(b + "downsample.1", o)
        c = o
bn("bn2", c); out["fc.weight"] = [32, c * 49]; out["fc.bias"] = [32]; bn("features", 32)
print(json.dumps({"module." + n: s for n, s in out.items()}))
P
    random_npz arc.npz <names.json
    status 0 spid-import arc.npz --as arcface -o arc.safetensors
    [ -z "$output" ]
    mkdir a
    "$PYTHON" -c 'import sys, random; sys.stdout.buffer.write(b"P6 112 112 255\n" + random.Random(1).randbytes(37632))' >a/0.ppm
    spid-eval -q -f tsv --arcface arc.safetensors a a | grep -q arcface
    "$PYTHON" -c '
import numpy as np
z = np.load("arc.npz")
np.savez("bad.npz", **{n: z[n][:-1] if "layer3.1.conv2" in n else z[n] for n in z.files if "layer2.0.prelu" not in n})'
    status 65 spid-import bad.npz --as arcface -o x.safetensors
    has 'missing: module.layer2.0.prelu.weight (expected [16])'
    has 'wrong shape: module.layer3.1.conv2.weight [23, 24, 3, 3] (expected [24, 24, 3, 3])'
}

@test "squeezenet: torchvision's normalisation goes into the first layer" {
    "$PYTHON" - >names.json <<'P'
import json
out = {"features.0.weight": [96, 3, 7, 7], "features.0.bias": [96], "classifier.1.weight": [1000, 512, 1, 1], "classifier.1.bias": [1000]}
for at, i, s, o in ((3, 96, 16, 64), (4, 128, 16, 64), (5, 128, 32, 128), (7, 256, 32, 128), (8, 256, 48, 192), (9, 384, 48, 192), (10, 384, 64, 256), (12, 512, 64, 256)):
    for n, (a, b, k) in {"squeeze": (s, i, 1), "expand1x1": (o, s, 1), "expand3x3": (o, s, 3)}.items():
        out[f"features.{at}.{n}.weight"] = [a, b, k, k]; out[f"features.{at}.{n}.bias"] = [a]
print(json.dumps(out))
P
    random_npz squeeze.npz <names.json
    status 0 spid-import squeeze.npz --as squeezenet -o squeeze.safetensors
    [ -z "$output" ]
    "$PYTHON" - <<'P'
import numpy as np, import_read
z = np.load("squeeze.npz")
got, _ = import_read.load("squeeze.safetensors")
assert sorted(got) == sorted(z.files)
for n in got:
    if not n.startswith("features.0."): assert np.array_equal(got[n], z[n]), n
x = np.random.default_rng(2).random((3, 7, 7))
mean, dev = np.array([.485, .456, .406]), np.array([.229, .224, .225])
y = np.einsum("oikl,ikl->o", z["features.0.weight"].astype("f8"), (x - mean[:, None, None]) / dev[:, None, None]) + z["features.0.bias"]
ours = np.einsum("oikl,ikl->o", got["features.0.weight"].astype("f8"), x) + got["features.0.bias"]
assert np.abs(y - ours).max() < 1e-5 * np.abs(y).max(), np.abs(y - ours).max()
P
}

@test "fan: hourglasses and width follow from the file; what is missing is listed" {
    fan_names 2 32 | random_npz fan.npz
    status 0 spid-import fan.npz --as fan -o fan.safetensors
    [ -z "$output" ]
    "$PYTHON" - <<'P'
import numpy as np, import_read
z = np.load("fan.npz")
got, _ = import_read.load("fan.safetensors")
assert sorted(got) == sorted(n for n in z.files if "num_batches" not in n)
assert all(np.array_equal(got[n], z[n]) for n in got)
np.savez("bad.npz", extra=np.zeros(3, "f4"), **{n: z[n][:-1] if n == "m1.b2_3.conv2.weight" else z[n]
    for n in z.files if n != "al0.bias"})
np.savez("none.npz", a=np.zeros(3))
np.savez("odd.npz", **{"m0.b1_4.bn1.weight": np.zeros(20, "f4")})
P
    status 65 spid-import bad.npz --as fan -o x.safetensors
    has 'missing: al0.bias (expected [32])'
    has 'wrong shape: m1.b2_3.conv2.weight [7, 16, 3, 3] (expected [8, 16, 3, 3])'
    has 'left over: extra [3]'
    status 65 spid-import none.npz --as fan -o x.safetensors
    has 'missing: m0.b1_4.bn1.weight'
    status 65 spid-import odd.npz --as fan -o x.safetensors
    has 'hourglasses of 20 channels (expected a multiple of 16 up to 1024)'
    [ ! -e x.safetensors ]
}

@test "gagavatar: all that is missing is listed, the first twenty by name" {
    "$PYTHON" -c '
import numpy as np
np.savez("g.npz", **{"model.head_base": np.zeros((5023, 256), "f4"), "model.base_model.dino_model.cls_token": np.zeros((1, 1, 384), "f4")})'
    status 65 spid-import g.npz --as gagavatar -o x.safetensors
    has 'wrong shape: model.base_model.dino_model.cls_token [1, 1, 384] (expected [1, 1, 768])'
    has 'missing: and 539 more'
    has '560 tensors are missing or have a wrong shape'
    [ "${#lines[@]}" -eq 23 ]
    [ ! -e x.safetensors ]
}
