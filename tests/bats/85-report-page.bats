#!/usr/bin/env bats
# spid-report: one page that stands alone.

TOP=${TOP:-$(cd "$BATS_TEST_DIRNAME/../.." && pwd)}

setup() {
    cd "$BATS_TEST_TMPDIR"
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
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
    run grep -Ei 'src="(http|/)|href="http|@import|fetch\(' page.html
    [ "$status" -eq 1 ]
}

# turning FILE SCALE: twelve frames whose head turns by up to SCALE x 22 degrees.
turning() {
    awk -v s="$2" 'BEGIN {
        for (f = 0; f < 12; f++) {
            a = s * f * 2 / 57.29578
            printf "{\"type\":\"MOTN\",\"frame\":%d,\"time\":%g,\"arrays\":{", f, f / 10
            printf "\"rot\":[[%.7f,0,%.7f],[0,-1,0],[%.7f,0,%.7f]],\"trans\":[0,0,12],\"exp\":[",
                cos(a), sin(a), sin(a), -cos(a)
            for (k = 0; k < 100; k++) printf "%s%g", k ? "," : "", k == 45 ? s * f / 12 : 0
            printf "],\"jaw\":[0,0,0],\"lid\":[0,0],\"eye\":[0,0,0,0,0,0]}}\n"
        }
    }' >turning.json
    spid-pack turning.json -o "$1"
}

@test "driver and result are compared, beside a line that does not move" {
    turning run/motion.spid 1
    turning run/result.spid .5
    turning run/me.spid 0
    spid-report run -o page.html
    # yaw 0, 2, .. 22 degrees against half of it and against none
    grep -q 'Result: mean difference 5.5°, correlation 1.00. Null line: mean difference 11°' page.html
    grep -q "Expression 46, ARKit.s mouthSmile_L" page.html
    head -c 1500 run/result.spid >cut && mv cut run/result.spid
    run spid-report run -o again.html
    [ "$status" -eq 65 ]
    [ "${#lines[@]}" -eq 1 ]
    [[ "$output" == *result.spid* ]]
    [ ! -e again.html ]
}

@test "the limits are those of the model's card" {
    mkdir model
    printf '# A model\n## Limits\n\n- It cannot `fly`\n  <high>.\n- Nor swim.\n\n## Use\n- walk\n' >model/README.md
    spid-report -m model run -o page.html
    grep -q '<li>It cannot fly &lt;high&gt;.</li>' page.html
    grep -q '<li>Nor swim.</li>' page.html
    run grep -q '<li>walk' page.html
    [ "$status" -eq 1 ]
}

@test "a browser without a network plays it, wipes it and follows its charts" {
    CHROMIUM=$(command -v chromium || command -v chromium-browser) || skip "no chromium (apt: chromium)"
    export CHROMIUM
    [ -d "$TOP/build/npm/node_modules/playwright-core" ] || skip "no playwright-core (apt: npm, then make deps)"
    for c in driver=0xc82828 avatar=0x283cc8; do
        ffmpeg -nostdin -v error -y -f lavfi -i color=${c#*=}:size=64x64:rate=10 -frames:v 12 \
            -pix_fmt yuv420p run/${c%%=*}.mp4
    done
    turning run/motion.spid 1
    spid-report run -o page.html
    timeout 500 node "$TOP/tests/npm/report.cjs" page.html
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
