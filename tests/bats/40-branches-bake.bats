# spid-branches: baking an avatar and moving it.
load helper
load animate

prepare() {
    animate_files
    motion 3
    spid-flame -m model -i avatar.spid motion.spid -o mesh.spid
}

@test "a baked avatar holds the identity and one GAUS that draws nothing" {
    spid-dump --check avatar.spid
    spid-dump avatar.spid >dump.txt
    for type in CONF SRCI SHAP MOTN GAUS; do grep -q "^$type" dump.txt; done
    [ "$(sed -n '/^GAUS/,$p' dump.txt | grep -c " cam ")" -eq 0 ]
}

@test "baking says how many were clamped and how many are never drawn" {
    status 0 spid-branches -m model --bake me.spid -o again.spid
    has "clamped"
    has "never drawn"
    cmp again.spid avatar.spid
}

@test "every frame is a GMOV of the dynamic centres, the shift and a camera" {
    spid-branches -i avatar.spid mesh.spid -o moved.spid
    spid-dump --check moved.spid
    [ "$(spid-dump moved.spid | grep -c '^GMOV')" = 3 ]
    [ "$(spid-dump moved.spid | grep -c '^GAUS')" = 1 ]
}

@test "an avatar that nothing moves is drawn as its source shows it" {
    need_numpy
    side=$(spid-dump avatar.spid | sed -n 's/^ *matte .*\[\([0-9]*\),.*/\1/p')
    spid-splat -q --imag -s "$side" avatar.spid -o still.spid
    [ "$(spid-dump still.spid | grep -c '^IMAG')" = 1 ]
    spid-dump --npy dir still.spid
    "$PYTHON" - <<'P'
import numpy as np
still, rgb, matte = (np.load(f"dir/{f}.npy").squeeze().astype(float)
                     for f in ("IMAG.rgb", "SRCI.rgb", "SRCI.matte"))
person = rgb * matte[..., None] / 255
both = (still.sum(2) > 0) & (matte > 250)
print(both.mean(), abs(still - person)[both].mean())
assert both.mean() > 0.1 and abs(still - person)[both].mean() < 12
P
}

@test "whole records draw the same picture as movements" {
    spid-branches -i avatar.spid mesh.spid -o moved.spid
    spid-branches -i avatar.spid --full mesh.spid -o full.spid
    spid-splat -q --size 64 moved.spid -o a.y4m
    spid-splat -q --size 64 full.spid -o b.y4m
    cmp a.y4m b.y4m
}

@test "branches can be left out before and after baking" {
    for part in dynamic static mouth interp; do
        spid-branches -q -m model --without $part --bake me.spid -o a.spid
        spid-branches -i a.spid mesh.spid -o m.spid
        spid-branches -i avatar.spid --without $part mesh.spid -o n.spid
        spid-splat -q --size 32 n.spid -o n.y4m
    done
    spid-branches -q -m model --without deform --bake me.spid -o a.spid
    status 64 spid-branches -i avatar.spid --without deform mesh.spid -o n.spid
    status 64 spid-branches -i avatar.spid --without nose mesh.spid -o n.spid
    has "nose"
}

@test "pruning reports what it dropped and the error that costs" {
    status 0 spid-branches -m model --prune 5 --bake me.spid -o p.spid
    has "pruned at 5 over 30 views"
    has "dB"
    [ "$(stat -Lc %s p.spid)" -lt "$(stat -Lc %s avatar.spid)" ]
}

@test "an avatar of another head is refused" {
    sed 's/.*/{"type":"MESH","arrays":{"verts":[[0,0,0],[1,0,0],[0,1,0]],"cam":[[1,0,0,0],[0,-1,0,0],[0,0,-1,12]],"lip":[0,0,0],"faces":[[0,1,2]]}}/;q' \
        motion-src.json >tri.json
    spid-pack -q tri.json -o tri.spid
    status 65 spid-branches -i avatar.spid tri.spid -o out.spid
    has "another head"
    [ ! -e out.spid ]
}

@test "an identity made with another model is refused" {
    mkdir other
    cp model/head.safetensors other/
    "$TOP/${BUILD:-build}/tests/unit/avatar_model" other/model.safetensors \
        shipped "$HEAD"
    status 65 spid-branches -m other --bake me.spid -o out.spid
    one_line
    [ ! -e out.spid ]
}

@test "a mesh stream that breaks off is reported and not finished" {
    head -c 100000 mesh.spid >cut.spid
    status 65 spid-branches -i avatar.spid cut.spid -o out.spid
    [ ! -e out.spid ]
}

@test "what cannot be asked for is misuse" {
    status 64 spid-branches mesh.spid
    status 64 spid-branches --bake me.spid -i avatar.spid
    status 64 spid-branches -i avatar.spid --prune 1 mesh.spid
}
