# examples/train-paper.sh from public files made here: a small architecture
# always, the paper's full size, minutes and gigabytes, with SPID_LONG=1 (make
# check-long).
load helper
load flame

# flame.pkl with its landmarks, dino.npz of a width, three clips.
prepare() {
    local i own=$TOP/${BUILD:-build}/share/spid/head.safetensors
    export PYTHONPATH=$BATS_TEST_DIRNAME
    need_numpy
    HEAD=plain.safetensors
    spid-head -q -o "$HEAD"
    flame_files
    cp landmarks.npy landmark_embedding.npy
    export HEAD=$own
    mkdir clips
    for i in 1 2 3; do
        spid-synth -q -n 1 --frames 6 -s $((i + 1)) --size 256 --head "$HEAD" -o clips/$i.y4m
    done
}

# alexnet_names, linear_names: what LPIPS takes, as JSON.
alexnet_names() {
    "$PYTHON" - <<'P'
import json
names = {}
for i, o, c, k in ((0, 64, 3, 11), (3, 192, 64, 5), (6, 384, 192, 3), (8, 256, 384, 3), (10, 256, 256, 3)):
    names.update({f"features.{i}.weight": [o, c, k, k], f"features.{i}.bias": [o]})
print(json.dumps(names))
P
}

linear_names() {
    echo '{"lin0.model.1.weight": [1, 64, 1, 1], "lin1.model.1.weight": [1, 192, 1, 1], "lin2.model.1.weight": [1, 384, 1, 1],
        "lin3.model.1.weight": [1, 256, 1, 1], "lin4.model.1.weight": [1, 256, 1, 1]}'
}

# runs WHAT...: train-paper.sh with these settings makes a model that animate
# runs, says what a step took, and has nothing to do when it is called again.
runs() {
    run env FRAMES=4 "$@" "$TOP/examples/train-paper.sh" flame.pkl dino.npz clips out
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$(wc -l <out/all/log.tsv)" -eq 3 ]
    # memory and time of a step, for who watches
    local cost
    cost=$(grep 's a step' <<<"$output" | tail -n 1)
    [[ $cost == *'2 steps, '*' MB summed in '*' GB' ]]
    echo "# $cost" >&3
    spid-synth -q -n 1 --frames 1 -s 9 --size 256 --head "$HEAD" -o me.png
    spid-animate -q -m out me.png clips/1.y4m -o me.y4m
    run env FRAMES=4 "$@" "$TOP/examples/train-paper.sh" flame.pkl dino.npz clips out
    [ "$status" -eq 0 ]
    [[ $output != *'s a step'* ]]
    [[ $output == *'3 clips: 0 made, 3 were there'* ]]
}

@test "a small architecture: FLAME, DINOv2, LPIPS and clips become a model that animate runs" {
    vit_names 384 "" | random_npz dino.npz
    alexnet_names | random_npz alexnet.npz
    linear_names | random_npz alex.npz
    fan_names 1 16 | random_npz fan.npz
    cat >small.json <<'J'
{
  "stage": "all", "seed": 1, "steps": 500000, "batch": 8, "micro": 1, "rate": 1e-4,
  "pool": 3, "image": 128, "targets": 1, "log_every": 1,
  "loss": { "square_landmarks": true, "anchor_start": 1, "anchor_end": 0.1, "anchor_steps": 250000 },
  "model": { "version": 1, "size": 128, "plane": 24, "mouth": 4, "channels": 8, "feature": 8,
    "motion": { "net": "mobilenetv3_small_100" }, "shape": { "net": "mobilenetv3_small_100" },
    "backbone": { "type": "dinov2", "embed": 384, "depth": 12, "heads": 6, "patch": 14, "image": 56 },
    "init": { "width": 8 }, "static": { "width": 8 }, "mouth_decoder": { "width": 8 },
    "dynamic": { "width": 8, "head": 8, "vertex": 8 },
    "rgb_skip": false, "refiner": { "type": "narrow", "width": 16 } }
}
J
    runs STEPS=2 BATCH=2 CONFIG=small.json PERCEPTUAL=alexnet.npz LINEAR=alex.npz \
        ALIGNMENT=fan.npz
    grep -q '"perceptual": "out/perceptual.safetensors"' out/all.json
    # L_lmk is the network's: a number, and none of the head's own landmarks
    awk 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i }
        NR > 1 && !($at["alignment"] > 0 && $at["landmark"] == 0) { bad = 1 }
        END { exit bad || NR < 3 }' out/all/log.tsv
    [ "$(wc -c <me.y4m)" -gt 100000 ]
}

@test "the paper's size: FLAME, DINOv2 and clips become a model that animate runs" {
    [ -n "${SPID_LONG:-}" ] || skip "long (make check-long)"
    vit_names 768 "" | random_npz dino.npz
    runs STEPS=2 BATCH=1
    [ "$(wc -c <me.y4m)" -gt 2000000 ]
}

@test "train-paper.sh says what it wants" {
    status 64 "$TOP/examples/train-paper.sh"
    has 'FLAME.pkl DINOV2.pth CLIPS OUT'
    has 'BATCH of the last one'
}
