#!/usr/bin/env bats
# spid-export --html --live: one page that a camera drives, in a real browser.
load helper

SHARE=$TOP/${BUILD:-build}/share/spid

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    [ -e "$SHARE/player-live.html" ] || return 0
    spid-synth -q --seed 32 --first 0 --people 1 --frames 1 --effects 0 -o me.png
    spid-shape -q me.png -o me.spid
    spid-branches -q --bake me.spid -o avatar.spid
    spid-synth -q --seed 31 --first 2 --people 1 --frames 40 --effects 0 -o driver.mp4
    # to the bit what both shall see, its colours named
    for format in yuv444p yuv420p; do
        ffmpeg -nostdin -v error -i driver.mp4 -c:v libvpx-vp9 -lossless 1 -cpu-used 8 \
            -vf scale=out_color_matrix=bt709:out_range=tv,format=$format -colorspace bt709 \
            -color_primaries bt709 -color_trc bt709 -color_range tv $format.webm
    done
    ffmpeg -nostdin -v error -i driver.mp4 -vf scale=240:240,pad=320:240:40:0,format=yuv420p \
        -r 25 camera.y4m
    spid-export -q avatar.spid --html page.html --live
}

setup() {
    cd "$BATS_TEST_TMPDIR"
    [ -e "$SHARE/player-live.html" ] || skip "no player-live.html (apt: npm, emscripten; then make web)"
    ln -s "$BATS_FILE_TMPDIR"/*.* .
}

need_browser() {
    CHROMIUM=$(command -v chromium || command -v chromium-browser) || skip "no chromium (apt: chromium)"
    export CHROMIUM
    [ -d "$TOP/build/npm/node_modules/playwright-core" ] || skip "no playwright-core (apt: npm, then make deps)"
}

@test "every frame's motion in the page is spid-motion's, within 2 % of its range" {
    need_browser
    timeout 600 node "$TOP/tests/npm/live.cjs" page.html 40 25 4 yuv444p.webm yuv420p.webm >out 2>&1 ||
        { cat out; false; }
    cat out
    for clip in yuv444p.webm yuv420p.webm; do
        window=$(sed -n 's/.*"window":{"x":\([-0-9.]*\),"y":\([-0-9.]*\),"size":\([0-9.]*\)}.*/\1,\2,\3/p' $clip.json)
        spid-motion -q --no-align --no-tta --precision f32 --window "$window" $clip |
            spid-dump --json --values >ours.json
        echo "$clip"
        node "$TOP/tests/npm/motions.cjs" $clip.json found ours.json
        # and so is what its person does since a neutral frame
        spid-motion -q --no-align --no-tta --precision f32 --window "$window" \
            --relative avatar.spid --neutral 4 $clip | spid-dump --json --values >ours.json
        node "$TOP/tests/npm/motions.cjs" $clip.json driven ours.json
    done
}

@test "a photograph becomes the avatar that the programs make of it, to 40 dB" {
    need_browser
    ffmpeg -nostdin -v error -i "$TOP/examples/photo.jpg" -vf scale=480:-1 photo.png
    ffmpeg -nostdin -v error -i photo.png -vf scale=360:480 small.png
    echo "no picture" >text.jpg
    ffmpeg -nostdin -v error -f lavfi -i color=gray:320x240 -frames:v 1 wall.png
    timeout 800 node "$TOP/tests/npm/face.cjs" page.html text.jpg wall.png photo.png small.png >out 2>&1 || { cat out; false; }
    cat out
}

@test "a camera drives it, is recorded with its mark, and may be refused" {
    need_browser
    MINUTES=${SPID_LONG:+10} timeout 1600 node "$TOP/tests/npm/camera.cjs" page.html camera.y4m >out 2>&1 || { cat out; false; }
    cat out
    run ffprobe -v error -show_entries format_tags -of default recorded.webm
    has "COMMENT=Synthetic: made by SpiD"
    # what is recorded shows the mark: light letters at the lower left
    ffmpeg -nostdin -v error -sseof -1 -i recorded.webm -frames:v 1 \
        -vf "crop=iw*2/3:ih/8:0:ih*7/8,format=gray" -f rawvideo mark.gray
    letters=$(od -An -v -tu1 -w1 mark.gray | awk '$1 > 100 { n++ } END { print n + 0 }')
    echo "$letters light pixels of the mark"
    [ "$letters" -gt 40 ]
}

@test "a page that cannot show an avatar says so in a sentence" {
    need_browser
    head -c -100000 page.html >cut.html
    sed '/id="avatar"/d' page.html >none.html
    timeout 600 node "$TOP/tests/npm/sorry.cjs" cut.html none.html page.html >out 2>&1 || { cat out; false; }
    cat out
}

@test "the page is under 25 MB, and the same bytes twice" {
    spid-export -q avatar.spid --html again.html --live
    cmp page.html again.html
    [ "$(stat -Lc %s page.html)" -lt 25000000 ]
}

@test "what makes no live page is one line" {
    status 64 spid-export avatar.spid --live --ply x.ply
    one_line
    has "expected --html FILE"
    status 65 spid-export -q --html no.html --live me.spid
    one_line
    has "no GAUS record"
    [ ! -e no.html ]
}
