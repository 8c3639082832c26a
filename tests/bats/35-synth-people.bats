#!/usr/bin/env bats
load helper

@test "the same seed gives the same bytes for any number of threads" {
    spid-synth -n 2 --frames 2 --size 64 -s 5 -j 1 -o "$BATS_TEST_TMPDIR/a"
    spid-synth -n 2 --frames 2 --size 64 -s 5 -j 2 -o "$BATS_TEST_TMPDIR/b"
    cmp "$BATS_TEST_TMPDIR/a" "$BATS_TEST_TMPDIR/b"
}

@test "another instruction set gives the same pictures" {
    SPID_CPU=baseline spid-synth --size 64 -s 5 --without mesh \
        -o "$BATS_TEST_TMPDIR/a.png"
    spid-synth --size 64 -s 5 --without mesh -o "$BATS_TEST_TMPDIR/b.png"
    cmp "$BATS_TEST_TMPDIR/a.png" "$BATS_TEST_TMPDIR/b.png"
}

@test "people are numbered on from --first" {
    spid-synth -n 3 --size 32 --without mesh -o "$BATS_TEST_TMPDIR/all"
    spid-synth -n 1 --first 2 --size 32 --without mesh \
        -o "$BATS_TEST_TMPDIR/last"
    spid-dump --json "$BATS_TEST_TMPDIR/all" > "$BATS_TEST_TMPDIR/all.json"
    spid-dump --json "$BATS_TEST_TMPDIR/last" > "$BATS_TEST_TMPDIR/last.json"
    grep -q SHAP "$BATS_TEST_TMPDIR/last.json"
    [ "$(grep -c SHAP "$BATS_TEST_TMPDIR/all.json")" -ge 1 ]
}

@test "the stream is whole and finite" {
    spid-synth -n 2 --frames 2 --size 48 -o "$BATS_TEST_TMPDIR/s"
    spid-dump --check "$BATS_TEST_TMPDIR/s"
}

@test "sizes and counts past the limits are refused" {
    for bad in --size=0 --size=100000 --size=abc --people=-1 --people=0 \
               --frames=-3 --effects=2 --without=mask --nothing; do
        run spid-synth "$bad" -o /dev/null
        [ "$status" -eq 64 ]
        [ "${#lines[@]}" -ge 1 ]
    done
    run spid-synth operand
    [ "$status" -eq 64 ]
}

@test "a missing head is named" {
    run spid-synth --head "$BATS_TEST_TMPDIR/none" -o /dev/null
    [ "$status" -eq 66 ]
    [[ "$output" == *none* ]]
}

@test "a closed pipe ends it quietly" {
    spid-synth -n 8 --size 48 2> "$BATS_TEST_TMPDIR/err" | head -c 1000 \
        > /dev/null
    [ ! -s "$BATS_TEST_TMPDIR/err" ]
}

@test "--turn says where each frame's head turns to" {
    need_numpy
    spid-synth -q --frames 3 --size 32 --without mesh --turn -45,10:20:5 \
        -o "$BATS_TEST_TMPDIR/s"
    spid-dump -q --npy "$BATS_TEST_TMPDIR/n" -o /dev/null "$BATS_TEST_TMPDIR/s"
    "$PYTHON" - "$BATS_TEST_TMPDIR/n/MOTN.rot.npy" <<'P'
import sys, numpy as np
rot = np.load(sys.argv[1])
out = rot[:, :, 2]              # where the face points, camera frame
yaw = np.degrees(np.arctan2(out[:, 0], -out[:, 2]))
pitch = np.degrees(np.arcsin(out[:, 1]))
assert np.allclose(yaw, [-45, yaw[1], -45], atol=1e-3), yaw
assert abs(yaw[1] - 10) < 3 and abs(pitch[1] - 20) < 3, (yaw, pitch)
assert np.allclose(pitch[[0, 2]], 0, atol=1e-3), pitch
P
    for bad in x 91 10: 10:20:30:40 10,; do
        run spid-synth --turn "$bad" -o /dev/null
        [ "$status" -eq 64 ]
        [ "${#lines[@]}" -eq 1 ]
    done
}

@test "an assets folder that is not there, or lacks a file, is named" {
    run spid-synth --assets "$BATS_TEST_TMPDIR/none" --size 32 -o /dev/null
    [ "$status" -eq 66 ]
    [[ "$output" == *none/ict/ict.safetensors* ]]
    mkdir -p "$BATS_TEST_TMPDIR/empty/ict"
    run spid-synth --assets "$BATS_TEST_TMPDIR/empty" --size 32 -o /dev/null
    [ "$status" -eq 66 ]
    [[ "$output" == *empty/ict/ict.safetensors* ]]
    [ "${#lines[@]}" -eq 1 ]
}

@test "scans that are cut or hold something else are refused by name" {
    mkdir -p "$BATS_TEST_TMPDIR/bad/ict"
    head -c 100 /dev/zero > "$BATS_TEST_TMPDIR/bad/ict/ict.safetensors"
    run spid-synth --assets "$BATS_TEST_TMPDIR/bad" --size 32 -o /dev/null
    [ "$status" -eq 65 ]
    [[ "$output" == *bad/ict/ict.safetensors* ]]
    head_file=$TOP/${BUILD:-build}/share/spid/head.safetensors
    cp "$head_file" "$BATS_TEST_TMPDIR/bad/ict/ict.safetensors"
    run spid-synth --assets "$BATS_TEST_TMPDIR/bad" --size 32 -o /dev/null
    [ "$status" -eq 65 ]
    [[ "$output" == *bad/ict/ict.safetensors*neutral* ]]
}

# With the assets at hand (SPID_ASSETS): the same promises for people of scans.
@test "people of scans: same bytes for any threads, whole, finite, labelled" {
    [ -n "$SPID_ASSETS" ] || skip "no shared assets (SPID_ASSETS)"
    for j in 1 2; do
        spid-synth --assets "$SPID_ASSETS" -n 2 --frames 2 --size 64 -s 5 \
            -j $j -o "$BATS_TEST_TMPDIR/$j"
    done
    cmp "$BATS_TEST_TMPDIR/1" "$BATS_TEST_TMPDIR/2"
    spid-dump --check "$BATS_TEST_TMPDIR/1"
    spid-dump --json "$BATS_TEST_TMPDIR/1" | grep -q alone
}

@test "people of scans: a bad asset of each kind is refused by name" {
    [ -n "$SPID_ASSETS" ] || skip "no shared assets (SPID_ASSETS)"
    for f in hdri/quarry_01_1k.hdr makehuman/base.obj ict/ict.safetensors \
             labels/photos.safetensors labels/mediapipe_to_ict.json \
             photos/london/001_neutral.jpg \
             makehuman/hair/bob02/bob02.mhclo; do
        rm -rf "$BATS_TEST_TMPDIR/d"
        cp -rs "$SPID_ASSETS" "$BATS_TEST_TMPDIR/d"
        chmod -R u+w "$BATS_TEST_TMPDIR/d"
        rm "$BATS_TEST_TMPDIR/d/$f"
        head -c 3000 "$SPID_ASSETS/$f" > "$BATS_TEST_TMPDIR/d/$f"
        run spid-synth --assets "$BATS_TEST_TMPDIR/d" --size 32 -o /dev/null
        [ "$status" -eq 65 ]
        [[ "$output" == *"$f"* ]]
    done
}

@test "traits are what people differ by; a wrong one is named" {
    traits=$BATS_TEST_DIRNAME/../../examples/config/traits.json
    one="spid-synth -n 3 --size 64 --without mesh"
    $one -o "$BATS_TEST_TMPDIR/a"
    $one --traits "$traits" -o "$BATS_TEST_TMPDIR/b"
    cmp "$BATS_TEST_TMPDIR/a" "$BATS_TEST_TMPDIR/b"
    sed 's/"skin_tone": [0-9.]*/"skin_tone": 0.9/' "$traits" \
        > "$BATS_TEST_TMPDIR/t"
    $one --traits "$BATS_TEST_TMPDIR/t" -o "$BATS_TEST_TMPDIR/b"
    run ! cmp -s "$BATS_TEST_TMPDIR/a" "$BATS_TEST_TMPDIR/b"
    for bad in 's/"talk": .0.6, /"talk": [/=talk' 's/"droop"/"drop"/=droop' \
               's/"jawForward"/"jawBack"/=jawBack' 's/"gum": /"gum": 1e999, "x": /=gum'; do
        sed "${bad%=*}" "$traits" > "$BATS_TEST_TMPDIR/t"
        run spid-synth --traits "$BATS_TEST_TMPDIR/t" -o /dev/null
        [ "$status" -eq 78 ]
        [ "${#lines[@]}" -eq 1 ]
        [[ "$output" == *"/t: "*"${bad#*=}"* ]]
    done
    head -c 999 "$traits" > "$BATS_TEST_TMPDIR/t"
    run spid-synth --traits "$BATS_TEST_TMPDIR/t" -o /dev/null
    [ "$status" -eq 65 ]
}
