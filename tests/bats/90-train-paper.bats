# examples/train-paper.sh at the paper's full size, from public files made here:
# minutes and gigabytes, so only with SPID_LONG=1 (make check-long).
load helper
load flame

prepare() {
    [ -n "${SPID_LONG:-}" ] || skip "long (make check-long)"
    export PYTHONPATH=$BATS_TEST_DIRNAME
    HEAD=$TOP/${BUILD:-build}/share/spid/head.safetensors
    need_numpy
}

@test "FLAME, DINOv2 and three clips become a model that animate runs" {
    local i
    local own=$HEAD
    HEAD=sculpted.safetensors               # its arrays are not packed
    spid-head -q -o "$HEAD"
    flame_files
    HEAD=$own
    cp landmarks.npy landmark_embedding.npy
    vit_names 768 "" | random_npz dino.npz
    mkdir clips
    for i in 1 2 3; do
        spid-synth -q -n 1 --frames 6 -s $i --size 256 --head "$HEAD" -o clips/$i.y4m
    done
    FRAMES=4 STEPS=2 BATCH=1 HEAD=$HEAD run "$TOP/examples/train-paper.sh" \
        flame.pkl dino.npz clips out
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$(wc -l <out/all/log.tsv)" -eq 3 ]
    has 's a step, '
    # memory and time of a step, for who watches
    echo "# ${lines[-1]}" >&3
    spid-synth -q -n 1 --frames 1 -s 9 --size 256 --head "$HEAD" -o me.png
    spid-animate -q -m out me.png clips/1.y4m -o me.y4m
    [ "$(wc -c <me.y4m)" -gt 2000000 ]
    # it was stopped nowhere: the same command has nothing left to do
    FRAMES=4 STEPS=2 BATCH=1 HEAD=$HEAD "$TOP/examples/train-paper.sh" \
        flame.pkl dino.npz clips out
}

@test "train-paper.sh says what it wants" {
    status 64 "$TOP/examples/train-paper.sh"
    has 'FLAME.pkl DINOV2.pth CLIPS OUT'
}
