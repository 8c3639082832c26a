#!/usr/bin/env bats
# spid-export --html: one page that plays the driven avatar, in a real browser.
load helper

SHARE=$TOP/${BUILD:-build}/share/spid
PLAYER=$SHARE/player.html

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    spid-synth -q --seed 32 --first 0 --people 1 --frames 1 --effects 0 -o me.png
    # the light that falls on me: from the left, above and before, whatever was found
    spid-shape -q me.png | spid-dump --json --values | sed '/"MOTN"/ {
        s/{"name":"light"[^}]*},//
        s/"arrays":\[/&{"name":"light","dtype":"f32","shape":[3],"data":[-0.3,-0.2,-0.2]},/
    }' >me.json
    spid-pack me.json -o me.spid
    # shown in another
    spid-branches -q --bake me.spid --light 50,30,0.5,#ffe8d0 -o avatar.spid
    # at rest; a smile with the jaw open, turned by 17 degrees; a wink, nodding
    # by 11 degrees, eyes aside
    awk 'BEGIN {
        for (f = 0; f < 3; f++) {
            c[0] = 1; c[1] = .954864; c[2] = 1; s[1] = .29704
            p[0] = 1; p[1] = 1; p[2] = .980067; q[2] = .198669
            printf "{\"type\":\"MOTN\",\"frame\":%d,\"time\":%g,\"arrays\":{", f, f / 10
            printf "\"rot\":[[%g,0,%g],[%g,%g,%g],[%g,%g,%g]],", c[f], s[f], q[f] * s[f],
                -p[f], q[f] * c[f], p[f] * s[f], q[f], -p[f] * c[f]
            printf "\"trans\":[%g,%g,%g],\"exp\":[", .1 * f, -.05 * f, 12 + f / 2
            for (k = 0; k < 100; k++)
                printf "%s%g", k ? "," : "", f == 1 && (k == 45 || k == 46) ? .9 : f * .01 * (k == 2)
            printf "],\"jaw\":[%g,%g,0],", .25 * (f == 1), .03 * f
            printf "\"lid\":[%g,0],\"eye\":[%g,%g,0,%g,%g,0]}}\n", .9 * (f == 2),
                .1 * f, .2 * f, .1 * f, .2 * f
        }
    }' >motion.json
    spid-pack motion.json -o motion.spid
}

setup() {
    cd "$BATS_TEST_TMPDIR"
    export XDG_DATA_HOME=$PWD
    ln -s "$BATS_FILE_TMPDIR"/*.spid .
}

need_player() { [ -e "$PLAYER" ] || skip "no player.html (apt: npm, then make web)"; }

need_browser() {
    need_player
    CHROMIUM=$(command -v chromium || command -v chromium-browser) || skip "no chromium (apt: chromium)"
    export CHROMIUM
    [ -d "$TOP/build/npm/node_modules/playwright-core" ] || skip "no playwright-core (apt: npm, then make deps)"
}

# refused CODE TEXT COMMAND...: one line with TEXT, and no page.
refused() {
    local code=$1 text=$2
    shift 2
    status "$code" "$@"
    one_line
    has "$text"
    [ -z "$(ls page.html* 2>/dev/null)" ]
}

@test "the page in a browser shows what spid-splat draws, keeps quiet and does as it is told" {
    need_browser
    spid-export -q -i avatar.spid motion.spid --html page.html
    timeout 800 node "$TOP/tests/npm/player.cjs" page.html 256 >out 2>&1 || { cat out; false; }
    cat out
    spid-flame -i avatar.spid motion.spid |
        spid-branches -i avatar.spid -o frames.spid
    for n in 0 1 2; do
        spid-splat -q -s 256 --camera "$(cat pose_$n.cam)" frames.spid -f png -o own_%06d.png
        db=$(ffmpeg -nostdin -i pose_$n.png -i "own_$(printf %06d $n).png" -lavfi psnr -f null - 2>&1 |
            sed -n 's/.*average:\([0-9.inf]*\).*/\1/p')
        echo "pose $n: $db dB"
        awk -v db="$db" 'BEGIN { exit !(db == "inf" || db >= 40) }'
    done
}

@test "ten seconds are under 12 MB, and the same bytes twice" {
    need_player
    awk 'BEGIN {
        for (f = 0; f < 250; f++) {
            printf "{\"type\":\"MOTN\",\"frame\":%d,\"time\":%g,\"arrays\":{\"rot\":[[1,0,0],[0,-1,0],[0,0,-1]],", f, f / 25
            printf "\"trans\":[0,0,12],\"exp\":["
            for (k = 0; k < 100; k++) printf "%s%g", k ? "," : "", sin(f * k)
            printf "],\"jaw\":[%g,0,0],\"lid\":[0,0],\"eye\":[0,0,0,0,0,0]}}\n", f / 1000
        }
    }' >long.json
    spid-pack long.json -o long.spid
    spid-export -i avatar.spid long.spid --html page.html
    spid-export -q -i avatar.spid long.spid --html again.html
    [ "$(stat -c %s page.html)" -lt 12000000 ]
    cmp page.html again.html
}

@test "an avatar alone makes a page of its own pose" {
    need_player
    run spid-export avatar.spid --html page.html
    has "0 frames"
    [ -s page.html ]
}

@test "a full disk is noticed" {
    need_player
    refused 74 page.html bash -c "trap '' XFSZ; ulimit -f 0
        spid-export -q -i avatar.spid motion.spid --html page.html"
}

@test "what makes no page is one line and no file" {
    need_player
    spid-flame -i avatar.spid motion.spid >mesh.spid
    refused 65 "expected MOTN records" spid-export -i avatar.spid mesh.spid --html page.html
    refused 65 "no GAUS record" spid-export -i me.spid motion.spid --html page.html
    refused 65 "no GAUS record" spid-export motion.spid --html page.html
    head -c 3000 motion.spid >cut.spid
    refused 65 "cut.spid" spid-export -i avatar.spid cut.spid --html page.html
    head -c 900000 avatar.spid >half.spid
    refused 65 "half.spid" spid-export -i half.spid motion.spid --html page.html
    spid-pack motion.spid motion.spid -o twice.spid
    refused 65 "expected increasing times" spid-export -i avatar.spid twice.spid --html page.html
}

@test "NaN, and more than a page can hold, are named" {
    need_player
    need_numpy
    spid-dump --only GAUS --npy parts avatar.spid
    "$PYTHON" - <<'PY'
import numpy as np
x = np.load("parts/GAUS.mean.npy")
x.reshape(-1)[7] = np.nan
np.save("parts/GAUS.mean.npy", x)
n = 1000001
for name, row in (("scale", 3), ("quat", 4), ("opacity", 0), ("color", 3), ("big", 3)):
    np.save(f"{name}.npy", np.full((n, row) if row else n, .01, "f4"))
np.save("branch.npy", np.ones(n, "u1"))
PY
    spid-pack parts -o nan.spid
    refused 65 "GAUS mean" spid-export nan.spid --html page.html
    spid-pack -t GAUS mean=big.npy scale.npy quat.npy opacity.npy color.npy branch.npy -o many.spid
    refused 65 "1000001 Gaussians" spid-export many.spid --html page.html
}

@test "without the player there is one line that says what to do" {
    cp "$(command -v spid-export)" .
    refused 66 "make web" ./spid-export --head "$SHARE/head.safetensors" -i avatar.spid \
        motion.spid --html page.html
    echo '<html>' >player.html
    mkdir spid && mv player.html spid/
    refused 65 "not a template" ./spid-export --head "$SHARE/head.safetensors" -i avatar.spid \
        motion.spid --html page.html
}
