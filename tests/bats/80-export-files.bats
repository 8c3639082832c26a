#!/usr/bin/env bats
# spid-export: what it writes is what others read.
load helper

prepare() {
    cat >make.py <<'PY'
import numpy as np
rng = np.random.default_rng(3)
n = 400
np.save("mean.npy", rng.uniform(-.5, .5, (n, 3)).astype("f4"))
np.save("scale.npy", rng.uniform(.005, .03, (n, 3)).astype("f4"))
q = rng.normal(size=(n, 4))
np.save("quat.npy", (q / np.linalg.norm(q, axis=1)[:, None]).astype("f4"))
np.save("opacity.npy", rng.uniform(.1, .95, n).astype("f4"))
np.save("color.npy", rng.uniform(0, 1, (n, 5)).astype("f4"))
np.save("branch.npy", np.zeros(n, "u1"))
np.save("cam.npy", np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 12]], "f4"))
PY
    /usr/bin/python3 -c 'import numpy' 2>/dev/null || skip "no numpy (apt: python3-numpy)"
    /usr/bin/python3 make.py
    spid-pack -t GAUS mean.npy scale.npy quat.npy opacity.npy color.npy \
        branch.npy cam.npy -o scene.spid
}

@test "a PLY is the Gaussians it was made of, turned to y down or as they are" {
    cat >read.py <<'PY'
import numpy as np, sys
head, data = open("face.ply", "rb").read().split(b"end_header\n", 1)
names = [l.split()[2] for l in head.decode().splitlines() if l.startswith("property float")]
assert len(names) == 17, names
x = np.frombuffer(data, "<f4").reshape(-1, 17)
col = {k: x[:, i] for i, k in enumerate(names)}
mean = np.load("mean.npy") * (float(sys.argv[1]), float(sys.argv[1]), 1)
assert all(np.allclose(col[k], mean[:, i]) for i, k in enumerate("xyz"))
assert np.allclose(np.exp(col["scale_1"]), np.load("scale.npy")[:, 1], rtol=1e-5)
assert np.allclose(1 / (1 + np.exp(-col["opacity"])), np.load("opacity.npy"), atol=1e-5)
c = .5 + .28209479177387814 * col["f_dc_2"]
assert np.allclose(c, np.load("color.npy")[:, 2], atol=1e-6)
assert np.allclose(sum(col[f"rot_{k}"] ** 2 for k in range(4)), 1, atol=1e-5)
PY
    spid-export -q scene.spid --ply face.ply
    /usr/bin/python3 read.py -1
    spid-export --lint face.ply
    spid-pack face.ply -o turned.spid
    spid-export -q --model-space scene.spid --ply face.ply
    /usr/bin/python3 read.py 1
    spid-pack --model-space face.ply -o up.spid
    cmp turned.spid up.spid
}

@test "an independent reader opens the PLY" {
    spid-export -q scene.spid --ply face.ply
    [ -d "$TOP/build/npm/node_modules/@loaders.gl/ply" ] || skip "no loaders.gl (apt: npm, then make deps)"
    /usr/bin/python3 -c 'import numpy as n
m = n.load("mean.npy") * [-1, -1, 1]
print("400 vertices, mean %.5f" % m.mean())' >expected
    node "$TOP/tests/npm/read_ply.cjs" face.ply | sed 's/.$//' >found
    cmp expected found
}

@test "feature channels that cannot be carried are announced" {
    run spid-export scene.spid --splat face.splat
    [ "$status" -eq 0 ]
    [[ "$output" == *"first three channels"* ]]
    [ "$(stat -c %s face.splat)" -eq $((400 * 32)) ]
}

@test "what is written is read back, drawn, and the difference printed" {
    spid-export scene.spid --ply a.ply --splat a.splat --glb-splats a.glb 2>err >out
    cat out
    # FILE: 400 Gaussians, read back and drawn: 66.7 dB, ...
    sed -n 's/^\([^:]*\): 400 Gaussians, read back and drawn: \([0-9.]*\) dB.*viewer.s rules \([0-9.]*\) dB$/\1 \2 \3/p' out >table
    [ "$(wc -l <table)" -eq 3 ]
    awk '{ if ($2 < ($1 == "a.splat" ? 40 : 100) || $3 < 40) exit 1 }' table
}

@test "three hundred frames take the memory of ten" {
    [[ $BUILD != *sanitize* ]] || skip "a sanitizer's memory is not the program's (no SANITIZE)"
    cat >frames.py <<'PY'
import numpy as np
for n in (10, 300):
    mean = np.load("mean.npy")[None] + np.linspace(0, .1, n, dtype="f4")[:, None, None]
    np.save(f"moved{n}.npy", mean.astype("f4"))
    np.save(f"cam{n}.npy", np.repeat(np.load("cam.npy")[None], n, 0))
    np.save(f"first{n}.npy", np.zeros((n, 1), "i4"))
PY
    /usr/bin/python3 frames.py
    for n in 10 300; do
        spid-pack -t GMOV -s --raw mean=moved$n.npy cam=cam$n.npy first=first$n.npy -o moves.spid
        spid-pack scene.spid moves.spid -o clip$n.spid
        /usr/bin/python3 - $n <<'PY' >peak$n
import resource, subprocess, sys
n = sys.argv[1]
subprocess.run(["spid-export", "-q", f"clip{n}.spid", "--ply", "f_%06d.ply"], check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
PY
    done
    echo "10 frames $(cat peak10) kB, 300 frames $(cat peak300) kB"
    [ "$(ls f_*.ply | wc -l)" -eq 300 ]
    [ "$(cat peak300)" -lt $(($(cat peak10) + 4096)) ]
}

@test "the same input gives the same bytes" {
    spid-export -q scene.spid --ply a.ply --glb-splats a.glb
    spid-export -q scene.spid --ply b.ply --glb-splats b.glb
    cmp a.ply b.ply
    cmp a.glb b.glb
}

@test "a GLB of Gaussians is clean to our lint and to the Khronos validator" {
    spid-export -q scene.spid --glb-splats face.glb
    spid-export --lint face.glb
    [ -d "$TOP/build/npm/node_modules/gltf-validator" ] || skip "no gltf-validator (apt: npm, then make deps)"
    node "$TOP/tests/npm/validate.cjs" face.glb
}

# moving N: motion.spid, N frames whose jaw opens and lids close.
moving() {
    cat >motion.py <<'PY'
import numpy as np, sys
n = int(sys.argv[1])
t = np.linspace(0, 1, n, dtype="f4")[:, None]
np.save("rot.npy", np.repeat(np.diag([1, -1, -1]).astype("f4")[None], n, 0))
np.save("trans.npy", np.repeat(np.array([[0, 0, 12]], "f4"), n, 0))
np.save("exp.npy", np.sin(np.arange(100) + 6 * t).astype("f4"))
np.save("jaw.npy", np.hstack([.3 * t, 0 * t, 0 * t]))
np.save("lid.npy", np.hstack([t, t]))
np.save("eye.npy", np.zeros((n, 6), "f4"))
PY
    /usr/bin/python3 motion.py "$1"
    spid-pack -t MOTN -s rot.npy trans.npy exp.npy jaw.npy lid.npy eye.npy -o motion.spid
}

@test "a GLB of the head is clean to the Khronos validator, and the same bytes twice" {
    HEAD=$TOP/${BUILD:-build}/share/spid/head.safetensors
    [ -e "$HEAD" ] || skip "no head model built (make)"
    moving 30
    spid-export -q --head "$HEAD" motion.spid --glb-head a.glb
    spid-export -q --head "$HEAD" --expressions 100 --correctives motion.spid --glb-head b.glb
    MALLOC_PERTURB_=85 spid-export -q --head "$HEAD" motion.spid --glb-head c.glb
    cmp a.glb c.glb
    # names that other programs know, of shapes that are there
    for name in mouthSmile_L browInnerUp_R eyeBlink_L; do grep -aq "\"$name\"" b.glb; done
    no grep -aq '"jawOpen"' b.glb
    # sparse accessors lie inside their views
    cat >sparse.py <<'PY'
import json, struct, sys
b = open(sys.argv[1], "rb").read()
g = json.loads(b[20:20 + struct.unpack("<I", b[12:16])[0]])
sparse = [a["sparse"] for a in g["accessors"] if "sparse" in a]
assert sparse
for s in sparse:
    for part, size in ((s["indices"], 2), (s["values"], 12)):
        assert part.get("byteOffset", 0) + size * s["count"] <= g["bufferViews"][part["bufferView"]]["byteLength"], s
PY
    /usr/bin/python3 sparse.py a.glb
    /usr/bin/python3 sparse.py b.glb
    [ -d "$TOP/build/npm/node_modules/gltf-validator" ] || skip "no gltf-validator (apt: npm, then make deps)"
    node "$TOP/tests/npm/validate.cjs" a.glb b.glb
}

@test "a GLB of the head is read back, and the difference to our mesh printed" {
    HEAD=$TOP/${BUILD:-build}/share/spid/head.safetensors
    [ -e "$HEAD" ] || skip "no head model built (make)"
    moving 3
    spid-export --head "$HEAD" motion.spid --glb-head few.glb >out
    spid-export --head "$HEAD" --expressions 198 --correctives motion.spid --glb-head all.glb >>out
    cat out
    # FILE: 5023 vertices, the first frame read back and drawn: 12.3 micrometres at most from our mesh, 45.6 dB
    sed -n 's/^\([^:]*\): [0-9]* vertices, the first frame read back and drawn: \([0-9.]*\) micrometres at most from our mesh, \([0-9.]*\) dB$/\1 \2 \3/p' out >table
    [ "$(wc -l <table)" -eq 2 ]
    awk '$1 == "few.glb" { few = $2 } $1 == "all.glb" { all = $2; db = $3 }
        END { exit !(all < 1000 && all < few && db > 30) }' table
}

@test "lint explains a PLY with linear opacities" {
    spid-export -q scene.spid --ply face.ply
    cat >break.py <<'PY'
import numpy as np
head, data = open("face.ply", "rb").read().split(b"end_header\n", 1)
x = np.frombuffer(data, "<f4").reshape(-1, 17).copy()
x[:, 9] = .5
open("bad.ply", "wb").write(head + b"end_header\n" + x.tobytes())
PY
    /usr/bin/python3 break.py
    run spid-export --lint bad.ply
    [ "$status" -eq 65 ]
    [[ "$output" == *"logits"* ]]
}

@test "a stream without Gaussians says what it lacked and leaves no file" {
    spid-pack -t SHAP shape=opacity.npy -o shape.spid
    run spid-export -q shape.spid --ply face.ply
    [ "$status" -eq 65 ]
    [[ "$output" == *"GAUS"* ]]
    [ ! -e face.ply ] && [ ! -e face.ply.part ]
}

@test "a truncated stream is reported and the exit is 65" {
    head -c 9000 scene.spid >cut.spid
    run spid-export -q cut.spid --ply face.ply
    [ "$status" -eq 65 ]
    [ ! -e face.ply ]
}

@test "a name with another conversion is refused" {
    run spid-export scene.spid --ply 'face_%s.ply'
    [ "$status" -eq 64 ]
    [[ "$output" == *"%s"* ]]
}

@test "spid-dump --ply and spid-pack bring a scene back" {
    spid-dump -q --ply face.ply scene.spid
    spid-pack face.ply -o back.spid
    spid-dump --npy back back.spid
    cat >compare.py <<'PY'
import numpy as np
for name, tol in (("mean", 0), ("scale", 1e-6), ("opacity", 1e-5)):
    a, b = np.load(name + ".npy"), np.load(f"back/GAUS.{name}.npy")[0]
    assert np.abs(a - b).max() <= tol, name
a, b = np.load("color.npy")[:, :3], np.load("back/GAUS.color.npy")[0]
assert np.abs(a - b).max() < 1e-6
a, b = np.load("quat.npy"), np.load("back/GAUS.quat.npy")[0]
assert (np.abs((a * b).sum(1)) > 1 - 1e-5).all()
PY
    /usr/bin/python3 compare.py
}

@test "spherical harmonics are evaluated for an eye, dropped, or refused" {
    cat >sh.py <<'PY'
import numpy as np
names = "x y z f_dc_0 f_dc_1 f_dc_2".split() + [f"f_rest_{i}" for i in range(9)] + \
    "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
row = dict.fromkeys(names, 0.); row["rot_0"] = 1; row["f_rest_1"] = .5   # red, band z
open("sh.ply", "wb").write(("ply\nformat binary_little_endian 1.0\nelement vertex 1\n" +
    "".join(f"property float {n}\n" for n in names) + "end_header\n").encode() +
    np.array([row[n] for n in names], "<f4").tobytes())
PY
    /usr/bin/python3 sh.py
    run spid-pack sh.ply -o x.spid
    [ "$status" -eq 65 ]
    [[ "$output" == *"degree 1"* ]]
    spid-pack --flat sh.ply | spid-dump --only GAUS | grep -q 'color.*min 0.5 .*max 0.5'
    # seen along +z the red channel gains sqrt(3/4pi) / 2
    spid-pack --eye 0,0,-3 sh.ply | spid-dump --only GAUS | grep -q 'color.*max 0.7443'
}

@test "PLY as text, big-endian, with doubles and other elements: the same scene" {
    spid-export -q scene.spid --ply face.ply
    spid-pack face.ply -o want.spid
    cat >forms.py <<'PY'
import numpy as np
head, data = open("face.ply", "rb").read().split(b"end_header\n", 1)
x = np.frombuffer(data, "<f4").reshape(-1, 17)
n = [l.split()[2] for l in head.decode().splitlines() if l.startswith("property")]
def put(path, form, rows, types, before="", after=b""):
    open(path, "wb").write((f"ply\r\nformat {form} 1.0\r\ncomment x\r\n{before}element vertex {len(x)}\r\n" + "".join(
        f"property {t} {name}\r\n" for t, name in zip(types, n)) +
        "element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n").encode() + rows + after)
text = "".join(" ".join("%.9g" % v for v in row) + "\r\n" for row in x).encode()
put("text.ply", "ascii", text, ["float"] * 17)
put("big.ply", "binary_big_endian", x.astype(">f4").tobytes(), ["float32"] * 17)
put("double.ply", "binary_little_endian", x.astype("<f8").tobytes(), ["double"] * 17)
put("camera.ply", "binary_big_endian", b"\0" * 5 + x.astype(">f4").tobytes(), ["float"] * 17,
    "element camera 1\r\nproperty uint8 a\r\nproperty int b\r\n")
put("short.ply", "ascii", text[:-40], ["float"] * 17)
put("word.ply", "ascii", text.replace(b"\r\n", b" x\r\n", 1), ["float"] * 17)
put("other.ply", "binary_middle_endian", b"", ["float"] * 17)
open("mesh.ply", "w").write("ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int i\n"
                            "element vertex 400\n" + "".join(f"property float {name}\n" for name in n) + "end_header\n")
PY
    /usr/bin/python3 forms.py
    for f in text big double camera; do
        spid-pack $f.ply -o $f.spid
        cmp <(spid-dump --values --only GAUS want.spid) <(spid-dump --values --only GAUS $f.spid)
    done
    run spid-export --lint text.ply
    has 'ascii numbers: several viewers read binary_little_endian only'
    while read -r file text; do
        status 65 spid-pack $file.ply -o x.spid
        one_line
        has "$file.ply: $text"
        [ ! -e x.spid ]
    done <<'END'
short ends at vertex 399
word vertex 1 is not 17 numbers
other 'format binary_middle_endian 1.0' (expected
mesh element face has lists
END
}

@test "SuperSplat's compressed PLY: a quarter of the size, the same picture" {
    spid-export scene.spid --ply a.ply --ply-compressed c.ply >out
    cat out
    db=$(sed -n 's/^c.ply: 400 Gaussians, read back and drawn: \([0-9.]*\) dB.*/\1/p' out)
    awk "BEGIN { exit !($db > 45) }"
    [ $((3 * $(stat -c %s c.ply))) -lt "$(stat -c %s a.ply)" ]
    spid-pack c.ply -o c.spid
    spid-dump --npy c c.spid
    cat >compare.py <<'PY'
import numpy as np
a, b = np.load("mean.npy"), np.load("c/GAUS.mean.npy")[0]
d = np.linalg.norm(a[:, None] - b[None], axis=2)
i = d.argmin(1)
assert len(set(i)) == len(a)                    # another order, none lost
assert d.min(1).max() < np.ptp(a, axis=0).max() / 1000
for name, tol in (("scale", .02), ("opacity", .006), ("color", .006)):
    p, q = np.load(name + ".npy"), np.load(f"c/GAUS.{name}.npy")[0][i]
    p = p[:, :3] if name == "color" else p
    assert np.abs(p - q).max() <= tol * max(1, np.abs(p).max()), (name, np.abs(p - q).max())
p, q = np.load("quat.npy"), np.load("c/GAUS.quat.npy")[0][i]
assert np.abs((p * q).sum(1)).min() > 1 - 1e-5
PY
    /usr/bin/python3 compare.py
    spid-export --lint c.ply
    head -c 2000 c.ply >cut.ply
    status 65 spid-pack cut.ply -o x.spid
    one_line
    sed 's/element chunk 2/element chunk 1/' c.ply >chunks.ply
    status 65 spid-pack chunks.ply -o x.spid
    has '1 chunks for 400 vertices'
}

@test "SuperSplat's own tool reads both forms of PLY and writes what we read" {
    tool=$TOP/build/npm/node_modules/@playcanvas/splat-transform/bin/cli.mjs
    [ -e "$tool" ] || skip "no npm @playcanvas/splat-transform (apt: npm, then make deps)"
    spid-export -q scene.spid --ply a.ply --ply-compressed c.ply
    node "$tool" -w a.ply theirs.compressed.ply
    node "$tool" -w c.ply theirs.ply
    for f in a c theirs.compressed theirs; do
        spid-pack $f.ply -o $f.spid
        spid-dump --npy $f $f.spid
    done
    cat >same.py <<'PY'
import numpy as np
def rows(d):
    return np.concatenate([np.load(f"{d}/GAUS.{k}.npy")[0].reshape(400, -1)
                           for k in ("mean", "scale", "opacity", "color", "quat")], 1)
ours, theirs = rows("c"), rows("theirs")        # their reader, our writer
assert np.abs(ours - theirs).max() < 1e-5, np.abs(ours - theirs).max()
plain, packed = rows("a"), rows("theirs.compressed")    # their writer, our reader
i = np.linalg.norm(plain[:, None, :3] - packed[None, :, :3], axis=2).argmin(1)
assert len(set(i)) == 400
assert np.abs(plain[:, :3] - packed[i, :3]).max() < np.ptp(plain[:, :3], axis=0).max() / 1000
PY
    /usr/bin/python3 same.py
}
