#!/usr/bin/env bats
# spid-report: one page that stands alone.

setup() {
    cd "$BATS_TEST_TMPDIR"
    command -v ffmpeg >/dev/null || skip "no ffmpeg"
    mkdir run
    ffmpeg -nostdin -v error -f lavfi -i testsrc=size=64x64:rate=10 -frames:v 12 \
        -pix_fmt yuv420p run/driver.mp4
    ffmpeg -nostdin -v error -f lavfi -i testsrc2=size=64x64:rate=10 -frames:v 12 \
        -pix_fmt yuv420p run/avatar.mp4
    ffmpeg -nostdin -v error -i run/driver.mp4 -frames:v 1 run/source.png
    printf 'stage\tcalls\ttotal_ms\tmean_ms\tmedian_ms\tp95_ms\nsplat\t12\t60\t5\t4.75\t6\n' >run/stats.tsv
    echo '{"psnr": 21.25, "without": {"mouth": 20.5}}' >run/metrics.json
}

@test "the page holds pictures, times and metrics and fetches nothing" {
    spid-report run -o page.html
    [ "$(grep -c 'data:image/png;base64,' page.html)" -ge 13 ]
    grep -q '4.75 ms' page.html
    grep -q 'without.mouth' page.html
    grep -q 'star: not in this run' page.html
    run grep -Ei 'src="(http|/)|href="http|@import|<script' page.html
    [ "$status" -eq 1 ]
}

@test "a browser without a network shows the page" {
    browser=$(command -v chromium || command -v chromium-browser) || skip "no chromium"
    spid-report run -o page.html
    "$browser" --headless --no-sandbox --disable-gpu --dump-dom \
        "file://$PWD/page.html" >dom.html 2>/dev/null
    grep -q '<h2>Error maps</h2>' dom.html
}

@test "the contact sheet has a row for each clip" {
    spid-report run --sheet sheet.png -o page.html
    [ "$(ffprobe -v error -show_entries stream=width,height -of csv=p=0 sheet.png)" = "1152,576" ]
}

@test "a damaged clip leaves no page" {
    head -c 600 run/avatar.mp4 >cut.mp4
    mv cut.mp4 run/avatar.mp4
    run spid-report run -o page.html
    [ "$status" -eq 65 ]
    [[ "$output" == *"avatar.mp4"* ]]
    [ ! -e page.html ] && [ ! -e page.html.part ]
}

@test "a run that is no folder is exit 66" {
    run spid-report run/source.png
    [ "$status" -eq 66 ]
}
