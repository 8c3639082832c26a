# What the tests of avatars share: a head, an untrained small model, a source
# picture and a driving clip of the synthetic people.
animate_files() {
    local build=$TOP/${BUILD:-build}
    HEAD=$build/share/spid/head.safetensors
    [ -e "$HEAD" ] || skip "no head model built (make)"
    [ -x "$build/tests/unit/avatar_model" ] || skip "no model maker built (make tests)"
    local dir=$BATS_FILE_TMPDIR
    if [ ! -e "$dir/ready" ]; then
        mkdir -p "$dir/model"
        "$build/tests/unit/avatar_model" "$dir/model/model.safetensors" \
            small "$HEAD"
        cp "$HEAD" "$dir/model/"
        spid-synth -q -n 1 --frames 4 -s 5 --size 256 --head "$HEAD" \
            -o "$dir/drive.y4m"
        spid-synth -q -n 1 --frames 1 -s 5 --size 256 --head "$HEAD" \
            -o "$dir/source.png"
        spid-shape -q -m "$dir/model" "$dir/source.png" -o "$dir/me.spid"
        spid-branches -q -m "$dir/model" --bake "$dir/me.spid" \
            -o "$dir/avatar.spid"
        touch "$dir/ready"
    fi
    ln -s "$dir"/{model,drive.y4m,source.png,me.spid,avatar.spid} .
}

# checkpoint_files UNIT: small.json from standard input, and $MAKER, a test program
# that makes a checkpoint of such a model.
checkpoint_files() {
    cat >small.json
    MAKER=$TOP/${BUILD:-build}/tests/unit/$1
    [ -x "$MAKER" ] || skip "no checkpoint maker built (make tests)"
    animate_files
}

# camera [OPTION ...]: the clip of four pictures over and over ($LOOPS times
# more, 2 when it is not set; -1: for ever), ten a second, or two where a
# sanitizer watches, as ffmpeg gives it with these options.
camera() {
    local rate=10
    [ "${BUILD:-build}" = build ] || rate=2
    ffmpeg -nostdin -v error -re -stream_loop "${LOOPS:-2}" -r $rate \
        -i drive.y4m "$@" -f yuv4mpegpipe -
}

# What the tests of spid-live start with.
live_files() {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    animate_files
}
