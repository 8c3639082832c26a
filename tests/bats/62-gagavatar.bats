# GAGAvatar's checkpoint as a model: a small one of random weights, with the
# encoders of a model of ours.
load helper
load animate

prepare() {
    checkpoint_files gagavatar_model <<'J'
{"system": "gagavatar", "size": 128, "plane": 24, "channels": 8, "feature": 16,
 "backbone": {"type": "dinov2", "embed": 24, "depth": 4, "heads": 2, "patch": 14, "image": 84},
 "static": {"width": 16}, "dynamic": {"width": 16, "head": 8, "vertex": 8},
 "public_quirks": true, "refiner": {"type": "style_unet", "multiplier": 0.0625}}
J
    "$MAKER" raw.safetensors small.json "$HEAD"
}

@test "the checkpoint with encoders becomes a model, which animate and the pipe run alike" {
    status 0 spid-import raw.safetensors --as gagavatar --config small.json \
        --encoders model/model.safetensors -o gagavatar.safetensors
    [ -z "$output" ]
    status 0 spid-shape -m gagavatar.safetensors --head "$HEAD" source.png -o me.g
    spid-branches -m gagavatar.safetensors --head "$HEAD" --bake me.g \
        -o avatar.g 2>said
    grep -q '6292 Gaussians, 5140 of them on vertices' said
    spid-animate -q --absolute -m gagavatar.safetensors --head "$HEAD" me.g \
        drive.y4m -o one.y4m
    set -o pipefail
    spid-motion -q -m gagavatar.safetensors --head "$HEAD" drive.y4m |
        spid-flame --head "$HEAD" -i avatar.g | spid-branches -i avatar.g |
        spid-splat -q --size 128 --channels 8 --rules dgr |
        spid-refine -q -m gagavatar.safetensors -o pipe.y4m
    cmp one.y4m pipe.y4m
    # it moves
    spid-dump --help >/dev/null
    [ "$(tail -c +60 one.y4m | head -c 24000 | md5sum)" != \
      "$(tail -c 24000 one.y4m | md5sum)" ]
}

@test "parameters from files drive it: MOTN records instead of a clip" {
    spid-import raw.safetensors --as gagavatar --config small.json \
        --encoders model/model.safetensors -o gagavatar.safetensors
    spid-shape -q -m gagavatar.safetensors --head "$HEAD" source.png -o me.g
    spid-branches -q -m gagavatar.safetensors --head "$HEAD" --bake me.g -o avatar.g
    motion 3
    spid-animate -q -m gagavatar.safetensors --head "$HEAD" avatar.g motion.spid \
        -o one.y4m
    set -o pipefail
    spid-flame --head "$HEAD" -i avatar.g motion.spid | spid-branches -i avatar.g |
        spid-splat -q --size 128 --channels 8 --rules dgr |
        spid-refine -q -m gagavatar.safetensors -o pipe.y4m
    cmp one.y4m pipe.y4m
}

@test "what cannot be is one line, and nothing is written" {
    status 66 spid-import raw.safetensors --as gagavatar --config model/none.json -o x.safetensors
    has 'model/none.json: '
    [ ! -e x.safetensors ]
    status 65 spid-import raw.safetensors --as gagavatar -o x.safetensors
    has 'wrong shape: head_base [5140, 8] (expected [5140, 256])'
    spid-import raw.safetensors --as gagavatar --config small.json -o bare.safetensors
    status 65 spid-animate -m bare.safetensors --head "$HEAD" source.png drive.y4m -o x.y4m
    has 'motion.'
    one_line
    spid-import raw.safetensors --as gagavatar --config small.json \
        --encoders model/model.safetensors -o gagavatar.safetensors
    spid-shape -q -m gagavatar.safetensors --head "$HEAD" source.png -o me.g
    status 64 spid-branches -m gagavatar.safetensors --head "$HEAD" --without mouth --bake me.g -o x.spid
    has 'a gagavatar has none of SpiD'
    one_line
    echo '{"system": "flying"}' >odd.json
    status 78 spid-import raw.safetensors --as gagavatar --config odd.json -o x.safetensors
    has 'odd.json: configuration: system is "flying" (expected "spid", "gagavatar" or "lam")'
    one_line
    [ ! -e x.safetensors ] && [ ! -e x.y4m ]
}
