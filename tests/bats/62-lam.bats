# LAM's checkpoint as a model: a small one of formula weights, with the encoders
# of a model of ours.
load helper
load animate

prepare() {
    checkpoint_files lam_model <<'J'
{"system": "lam", "size": 128, "channels": 3, "feature": 24,
 "backbone": {"type": "dinov2", "embed": 24, "depth": 4, "heads": 2, "patch": 14, "image": 84, "registers": 2},
 "dynamic": {"width": 32, "head": 16}, "transformer": {"layers": 2, "heads": 2}, "refiner": null}
J
    if [ ! -e "$BATS_FILE_TMPDIR/fine.safetensors" ]; then
        "$MAKER" "$BATS_FILE_TMPDIR/raw.safetensors" small.json
        spid-head --head "$HEAD" --subdivide -o fine.safetensors
        mv fine.safetensors "$BATS_FILE_TMPDIR"
    fi
    ln -s "$BATS_FILE_TMPDIR"/{raw,fine}.safetensors .
}

# import HEAD: the checkpoint with encoders for that head as lam.safetensors.
import() {
    spid-import raw.safetensors --as lam --config small.json \
        --encoders model/model.safetensors --from-head "$HEAD" \
        --head "$1" -o lam.safetensors
}

@test "a photograph becomes an avatar, which animate and the pipe drive alike" {
    status 0 import "$HEAD"
    [ -z "$output" ]
    local use=(-q -m lam.safetensors --head "$HEAD")
    status 0 spid-shape "${use[@]}" source.png -o me.l
    spid-branches "${use[@]}" --bake me.l -o avatar.l
    spid-dump --check avatar.l
    spid-animate "${use[@]}" --absolute me.l drive.y4m -o one.y4m
    set -o pipefail
    spid-motion "${use[@]}" drive.y4m | spid-flame --head "$HEAD" -i avatar.l |
        spid-branches -i avatar.l |
        spid-splat -q --size 128 --channels 3 --rules dgr -o pipe.y4m
    cmp one.y4m pipe.y4m
    # it moves
    [ "$(tail -c +60 one.y4m | head -c 24000 | md5sum)" != \
      "$(tail -c 24000 one.y4m | md5sum)" ]
    # an avatar is driven as its photograph is, and made anew the same
    spid-branches "${use[@]}" --bake avatar.l -o again.l
    for avatar in avatar.l again.l; do
        spid-animate "${use[@]}" --absolute $avatar drive.y4m -o two.y4m
        cmp one.y4m two.y4m
    done
}

@test "on the subdivided head: posed vertices, moved by their offsets at rest" {
    need_numpy
    status 0 import fine.safetensors
    [ -z "$output" ]
    local use=(-m lam.safetensors --head fine.safetensors)
    spid-shape -q "${use[@]}" source.png -o me.l
    spid-branches "${use[@]}" --bake me.l -o avatar.l 2>said
    grep -q '20366 Gaussians, 20366 of them on vertices' said
    motion 3
    spid-flame --head fine.safetensors -i avatar.l motion.spid -o mesh.spid
    spid-flame --head fine.safetensors -i me.l motion.spid -o plain.spid
    spid-branches -i avatar.l mesh.spid -o moved.spid
    spid-splat -q --size 128 --channels 3 --rules dgr moved.spid -o out.y4m
    for s in mesh plain moved; do spid-dump --npy $s.d $s.spid; done
    spid-dump --npy avatar.d avatar.l
    "$PYTHON" - <<'PY'
import numpy as np
verts = np.load("mesh.d/MESH.verts.npy")
plain = np.load("plain.d/MESH.verts.npy")
mean = np.load("moved.d/GMOV.mean.npy")
assert np.abs(mean - verts).max() == 0
offset = np.load("avatar.d/SHAP.offset.npy").reshape(-1, 3)
assert 0.05 < np.abs(offset).max() <= 0.5       # 0.2 m / 2 at 5 a metre
assert np.abs(verts[0] - plain[0] - offset).max() < 2e-6    # at rest
luma = np.frombuffer(open("out.y4m", "rb").read()[-49152:][:16384], "u1")
assert luma.std() > 10, luma.std()              # something is drawn
PY
}

@test "what cannot be is one line, and nothing is written" {
    need_numpy
    status 65 spid-import raw.safetensors --as lam -o x.safetensors
    has 'wrong shape: encoder.model.cls_token [1, 1, 24] (expected [1, 1, 1024])'
    "$PYTHON" - <<'PY'
import json, struct
data = open("raw.safetensors", "rb").read()
n = struct.unpack("<Q", data[:8])[0]
head = json.loads(data[8:8 + n])
def write(name, change):
    h = json.loads(json.dumps(head))
    change(h)
    text = json.dumps(h).encode()
    text += b" " * (-(8 + len(text)) % 64)
    open(name, "wb").write(struct.pack("<Q", len(text)) + text + data[8 + n:])
def lack(h):
    h["spare"] = h.pop("transformer.layers.1.attn.norm_added_k.weight")
def turn(h):
    h["renderer.gs_net.out_layers.rotation.weight"]["shape"] = [32, 4]
def basis(h):
    t = h.pop("transformer.layers.1.attn.norm_added_k.weight")
    h["renderer.flame_model.lbs_weights_up"] = t
write("lack.safetensors", lack)
write("turn.safetensors", turn)
write("flame.safetensors", basis)
PY
    status 65 spid-import lack.safetensors --as lam --config small.json -o x.safetensors
    has 'missing: transformer.layers.1.attn.norm_added_k.weight (expected [16])'
    has 'left over: spare'
    has 'not a whole lam: 1 tensors are missing or have a wrong shape'
    status 65 spid-import turn.safetensors --as lam --config small.json -o x.safetensors
    has 'wrong shape: renderer.gs_net.out_layers.rotation.weight [32, 4] (expected [4, 32])'
    # the head's own arrays in a checkpoint are nobody's loss
    status 65 spid-import flame.safetensors --as lam --config small.json -o x.safetensors
    no has 'left over'
    sed 's/"channels": 3/"channels": 32/' small.json >wide.json
    status 78 spid-import raw.safetensors --as lam --config wide.json -o x.safetensors
    has 'lam with 32 channels and no refiner (expected 3 and none)'
    one_line
    sed 's/"system": "lam"/"system": "spid"/' small.json >spid.json
    status 78 spid-import raw.safetensors --as lam --config spid.json -o x.safetensors
    has 'backbone.registers: 2 (expected 0: only "lam" has any)'
    import "$HEAD"
    status 78 spid-branches -m lam.safetensors --head fine.safetensors --bake me.spid -o x.spid
    has 'model was made for head'
    one_line
    status 64 spid-branches -m lam.safetensors --head "$HEAD" --without mouth --bake me.spid -o x.spid
    has "a lam has none of SpiD's parts"
    one_line
    [ ! -e x.safetensors ] && [ ! -e x.spid ]
}
