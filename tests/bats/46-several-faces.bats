# Pictures and clips of several people: said, chosen, and followed.
load helper

MODEL=$TOP/examples/model

prepare() {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
}

# A large face on the right, a smaller one on the left.
two() {
    ffmpeg -v error -y -i "$TOP/examples/photo.jpg" -filter_complex \
        "[0]scale=400:-1,crop=400:400[a];[0]hflip,scale=300:-1,crop=300:300,pad=300:400:0:60[b];[b][a]hstack" \
        -frames:v 1 two.png
}

# crop N FILE: middle and side of the face crop in frame N.
crop() {
    spid-dump --json --values --only MOTN "$2" | sed -n "$(($1 + 1))p" |
        sed 's/.*"name":"crop"[^]]*\][^[]*\[\([0-9]*\)[^,]*,\([0-9]*\)[^,]*,\([0-9]*\).*/\1 \2 \3/'
}

@test "two faces are said with their places; --face and --crop choose" {
    two
    run spid-shape -m "$MODEL" two.png -o one.spid
    [ "$status" -eq 0 ]
    has 'two.png: 2 faces (1 at '
    has 'number 1 is taken (--face N takes another)'
    # where the second is goes into --crop as it stands
    at=$(sed -n 's/.*, 2 at \([0-9,]*\)).*/\1/p' <<<"$output")
    [ "${at%%,*}" -lt 300 ]
    run spid-shape -m "$MODEL" --face 2 two.png -o two.spid
    has 'number 2 is taken'
    run spid-shape -m "$MODEL" --crop "$at" two.png -o crop.spid
    [ "$status" -eq 0 ]
    [ -z "$output" ]
    # the window of each is about its face
    x() { spid-dump --json --values --only SRCI "$1" | sed 's/.*"crop"[^]]*][^[]*"data":\[\([0-9]*\).*/\1/'; }
    [ "$(x one.spid)" -gt 400 ]
    [ "$(x two.spid)" -lt 250 ]
    [ "$(x crop.spid)" -lt 250 ]
    status 65 spid-shape -m "$MODEL" --face 3 two.png -o x.spid
    has '2 faces in a picture of 700 x 400 pixels (expected 3 for --face)'
    [ ! -e x.spid ]
    run spid-shape -m "$MODEL" "$TOP/examples/photo.jpg" -o x.spid
    [ -z "$output" ]
}

@test "spid-animate takes the source's face and the driver's" {
    two
    spid-animate -s -m "$MODEL" --face 2 two.png "$TOP/examples/photo.jpg" -o a-%d.png 2>said
    grep -q 'two.png: 2 faces .*number 2 is taken (--face' said
    spid-animate -s -m "$MODEL" --driver-face 2 "$TOP/examples/photo.jpg" two.png -o b-%d.png 2>said
    grep -q 'two.png: 2 faces .*number 2 is taken (--driver-face' said
    grep -q '^spid-animate: 1 frame, ' said
    [ -s a-0.png ]
    [ -s b-0.png ]
    status 65 spid-animate -q -s -m "$MODEL" --driver-face 3 "$TOP/examples/photo.jpg" two.png -o c.png
    one_line
    has '2 faces seen in 1 frame of'
    [[ $output != *--face* ]]       # which is the source's
    [ ! -e c.png ]
}

@test "the face chosen is followed when another walks before it" {
    spid-synth -q -n 1 --frames 1 -s 8 --size 400 -o walker.png
    ffmpeg -v error -y -loop 1 -t 4 -r 25 -i "$TOP/examples/photo.jpg" \
        -loop 1 -t 4 -r 25 -i walker.png -filter_complex \
        "[0]scale=300:-1,crop=300:300,pad=800:300:250:0:gray[a];[1]scale=300:300[b];[a][b]overlay=x=-300+t*300" \
        -t 4 walk.mp4
    spid-motion -q -m "$MODEL" walk.mp4 -o walk.spid
    read -r x0 y0 s0 < <(crop 5 walk.spid)
    read -r x1 y1 s1 < <(crop 80 walk.spid)
    echo "$x0 $y0 $s0, then $x1 $y1 $s1"
    [ $(((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))) -lt $((s0 * s0 / 25)) ]
}
