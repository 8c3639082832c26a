#!/usr/bin/env bats
# Takes of Live Link Face: spid-motion writes them, spid-pack reads them, an
# avatar is driven by one.
load helper

SCANS=$TOP/examples/model/head.safetensors

shapes="EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,EyeLookUpLeft\
,EyeSquintLeft,EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight\
,EyeLookOutRight,EyeLookUpRight,EyeSquintRight,EyeWideRight,JawForward,JawRight\
,JawLeft,JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft\
,MouthSmileLeft,MouthSmileRight,MouthFrownLeft,MouthFrownRight\
,MouthDimpleLeft,MouthDimpleRight,MouthStretchLeft,MouthStretchRight\
,MouthRollLower,MouthRollUpper,MouthShrugLower,MouthShrugUpper\
,MouthPressLeft,MouthPressRight,MouthLowerDownLeft,MouthLowerDownRight\
,MouthUpperUpLeft,MouthUpperUpRight,BrowDownLeft,BrowDownRight,BrowInnerUp\
,BrowOuterUpLeft,BrowOuterUpRight,CheekPuff,CheekSquintLeft\
,CheekSquintRight,NoseSneerLeft,NoseSneerRight,TongueOut"
angles="HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll\
,RightEyeYaw,RightEyePitch,RightEyeRoll"

# take N [ROW...]: N rows as a phone records them, 30 pictures a second on
# timecodes of 60; the jaw opens, the head turns to the subject's right.  The
# rows named have no face.
take() {
    local n=$1 i k
    shift
    printf 'Timecode,BlendShapeCount,%s,%s\r\n' "$shapes" "$angles"
    for ((i = 0; i < n; i++)); do
        printf '16:48:%02d:%02d.138,' $((i / 30)) $((2 * i % 60))
        if [[ " $* " == *" $i "* ]]; then
            printf '0\r\n'
            continue
        fi
        printf 61
        for ((k = 0; k < 61; k++)); do
            case $k in
            17) printf ',0.%02d' $((i * 90 / n)) ;;
            52) printf ',0.%02d' $((i * 50 / n)) ;;
            *) printf ',0.0000000000' ;;
            esac
        done
        printf '\r\n'
    done
}

# numbers NAME FILE: the array's numbers, frame by frame.
numbers() {
    spid-dump --json --values --only MOTN "$2" |
        sed "s/.*\"name\":\"$1\"[^]]*\"shape\":[^]]*][^[]*\"data\":\[\([^]]*\)].*/\1/"
}

@test "a take is a motion: times, jaw, held frames flagged" {
    take 40 5 6 | grep -v '^16:48:00:40' >take.csv
    run spid-pack --arkit take.csv --head "$SCANS" -o out.spid
    has 'no face or no row in 3 of 40 frames'
    spid-dump --check out.spid
    run spid-dump --json out.spid
    has '"frame":39,"time":1.3'
    [ "$(grep -c '"name":"lost"' <<<"$output")" -eq 3 ]
    numbers jaw out.spid >jaw
    [ "$(sed -n 5p jaw)" = "$(sed -n 7p jaw)" ]     # held
    [ "$(sed -n 7p jaw)" != "$(sed -n 8p jaw)" ]
}

@test "a file, a pipe and a fifo give the same records" {
    take 40 5 >take.csv
    spid-pack -q --arkit take.csv --head "$SCANS" -o file.spid
    spid-pack -q --arkit - --head "$SCANS" <take.csv >pipe.spid
    mkfifo fifo
    cat take.csv >fifo &
    spid-pack -q --arkit fifo --head "$SCANS" -o fifo.spid
    cmp file.spid pipe.spid
    cmp file.spid fifo.spid
}

@test "a row that comes is a record that goes" {
    mkfifo rows records
    spid-pack -q --arkit - --head "$SCANS" <rows >records &
    exec 7>rows 8<records
    take 3 | head -n 2 >&7
    # CONF (64 + 256 bytes) and one MOTN (64 + 1280) arrive with the rows open.
    run timeout 20 head -c 1500 <&8
    [ "${#output}" -gt 0 ]
    exec 7>&- 8<&-
    wait || true
}

@test "spid-motion writes a take, spid-pack reads it: the same motion" {
    local build=$TOP/${BUILD:-build}
    "$build/tests/unit/track_motion" --model model.safetensors
    for i in 1 2 3; do
        printf 'P6 64 48 255\n'
        yes "spid $i stripes" | tr '\n' ' ' | head -c 9216
    done >clip.ppm
    spid-motion -q -m model.safetensors --head "$SCANS" --crop 32,24,40 \
        --arkit take.csv -o sent.spid clip.ppm
    spid-motion -q -m model.safetensors --head "$SCANS" --crop 32,24,40 \
        --arkit - clip.ppm >piped.csv
    cmp take.csv piped.csv
    [ "$(head -n 1 take.csv)" = "Timecode,BlendShapeCount,$shapes,$angles" ]
    [ "$(wc -l <take.csv)" -eq 4 ]
    spid-pack -q --arkit take.csv --head "$SCANS" -o got.spid
    for name in rot eye lid; do
        paste -d, <(numbers $name sent.spid) <(numbers $name got.spid) |
            awk -F, '{ for (i = 1; i <= NF / 2; i++) {
                d = $i - $(i + NF / 2); if (d < 0) d = -d
                if (d > 1e-3) bad = 1 } }
                END { exit bad || NR != 3 }'
    done
}

@test "a take recorded elsewhere drives an avatar" {
    local build=$TOP/${BUILD:-build}
    [ -x "$build/tests/unit/avatar_model" ] || skip "no model maker built (make tests)"
    mkdir model
    cp "$SCANS" model/head.safetensors
    "$build/tests/unit/avatar_model" model/model.safetensors small "$SCANS"
    spid-synth -q -n 1 --frames 1 -s 5 --size 256 \
        --head "$build/share/spid/head.safetensors" -o source.png
    spid-shape -q -m model source.png -o me.spid
    spid-branches -q -m model --bake me.spid -o avatar.spid
    take 6 >take.csv
    spid-pack -q -m model --arkit take.csv --relative me.spid |
        spid-flame -m model -i avatar.spid | spid-branches -i avatar.spid |
        spid-splat -q --size 128 -o f-%d.png
    [ "$(ls f-*.png | wc -l)" -eq 6 ]
    ! cmp -s f-0.png f-5.png
}

@test "other programs' takes: semicolons, decimal commas, tabs, L and R, Excel's line" {
    take 12 5 >take.csv
    sed 's/,/;/g; 2,$s/\./,/g' take.csv >semicolon.csv
    { printf 'sep=;\r\n'; cat semicolon.csv; } >excel.csv
    tr , '\t' <take.csv >tab.csv
    sed '1s/Left/_L/g; 1s/Right/_R/g' take.csv >letters.csv
    sed '1s/.*/\L&/; 1s/timecode/Timecode/; 1s/\([a-z]\)left/\1_left/g; 1s/jawopen/jaw open/' take.csv >small.csv
    # two sides of one weight, with the mean that the one column had
    awk -F, -v OFS=, '{ sub(/\r/, "")
        if (NF > 2) $0 = $0 OFS (NR == 1 ? "CheekPuff_R" : $49); print }' take.csv |
        sed '1s/CheekPuff,/CheekPuff_L,/' >sides.csv
    spid-pack -q --arkit take.csv --head "$SCANS" -o want.spid
    # thousandths of a second in place of frames
    awk -F, -v OFS=, 'NR > 1 { split($1, t, /[:.]/)
        $1 = sprintf("%s:%s:%s.%06d", t[1], t[2], t[3], (t[4] + t[5] / 1000) / 60 * 1000000 + 0.5) } { print }' take.csv >clock.csv
    # as Windows writes text, either byte first
    { printf '\xff\xfe'; iconv -t UTF-16LE excel.csv; } >windows.csv
    { printf '\xfe\xff'; iconv -t UTF-16BE take.csv; } >other.csv
    for f in semicolon excel tab letters small sides windows other; do
        spid-pack -q --arkit $f.csv --head "$SCANS" -o got.spid
        cmp want.spid got.spid || { echo $f; false; }
    done
    spid-pack -q --arkit clock.csv --head "$SCANS" -o got.spid
    times() { spid-dump --only MOTN "$1" | sed -n 's/^MOTN frame [0-9]*, \([0-9.]*\) s.*/\1/p'; }
    paste <(times want.spid) <(times got.spid) |
        awk '{ d = $1 - $2; if (d < 0) d = -d; if (d > 1e-4) bad = 1 } END { exit bad || NR != 12 }'
}

@test "rows of a timecode that was there are left out and counted" {
    take 6 >take.csv
    awk 'NR > 1 { print } { print }' take.csv >twice.csv
    spid-pack -q --arkit take.csv --head "$SCANS" -o want.spid
    run spid-pack --arkit twice.csv --head "$SCANS" -o got.spid
    one_line
    has 'twice.csv: 6 rows left out for timecodes that were there already'
    cmp want.spid got.spid
}

@test "a take drives a photograph in one command, as through the pipe" {
    local build=$TOP/${BUILD:-build}
    [ -x "$build/tests/unit/avatar_model" ] || skip "no model maker built (make tests)"
    mkdir model
    cp "$SCANS" model/head.safetensors
    "$build/tests/unit/avatar_model" model/model.safetensors small "$SCANS"
    spid-synth -q -n 1 --frames 1 -s 5 --size 256 \
        --head "$build/share/spid/head.safetensors" -o source.png
    spid-shape -q -m model source.png -o me.spid
    spid-branches -q -m model --bake me.spid -o avatar.spid
    take 6 >take.csv
    spid-pack -q -m model --arkit take.csv --relative me.spid -o motion.spid
    spid-animate -q -s -m model avatar.spid motion.spid -f png -o a-%d.png
    spid-animate -q -s -m model avatar.spid take.csv -f png -o b-%d.png
    spid-animate -q -s -m model --absolute avatar.spid take.csv -f png -o c-%d.png
    [ "$(ls a-*.png | wc -l)" -eq 6 ]
    [ "$(ls b-*.png | wc -l)" -eq 6 ]
    for i in 0 1 2 3 4 5; do cmp a-$i.png b-$i.png; done
    no cmp -s b-5.png c-5.png
    status 65 spid-motion -q -m model take.csv -o e.spid
    one_line
    has 'take.csv: a take of Live Link Face, not pictures'
    [ ! -e e.spid ]
}

@test "columns that mean nothing are named; their order is free" {
    take 3 | awk -F, -v OFS=, '{ sub(/\r/, "")
        print "x", $0, NR == 1 ? "Mood" : "9" }' |
        sed 's/EyeBlinkLeft/eyeBlinkLeft/' >take.csv
    run spid-pack --arkit take.csv --head "$SCANS" -o out.spid
    one_line
    has 'take.csv: 2 columns not used: x, Mood'
}

@test "another head is refused in a line" {
    take 3 >take.csv
    other_head other.safetensors
    status 78 spid-pack --arkit take.csv --head other.safetensors -o out.spid
    one_line
    has "the head has not ARKit's expressions"
    [ ! -e out.spid ]
}

@test "bad files: one line with file, row and column, no output" {
    take 3 >good.csv
    sed '2,$s/,0\./,0,/g' good.csv >commas.csv
    sed 's/,JawOpen//' good.csv >missing.csv
    sed '3s/0\.0000000000/nan/' good.csv >nan.csv
    sed '4s/,0\.0000000000\r//' good.csv >short.csv
    : >empty.csv
    while read -r file text; do
        status 65 spid-pack --arkit $file.csv --head "$SCANS" -o out.spid
        one_line
        has "spid-pack: $file.csv: $text"
        [ ! -e out.spid ]
    done <<'END'
commas row 2: 124 fields
missing row 1: no column JawOpen
nan row 3: column EyeBlinkLeft: 'nan'
short row 4: 62 fields
empty empty
END
    status 66 spid-pack --arkit none.csv --head "$SCANS" -o out.spid
    one_line
}
