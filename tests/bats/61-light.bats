#!/usr/bin/env bats
# The light that an avatar is shown in: the photograph's own changes nothing, lamps
# brighten the cheek that they are beside, and every way to say it gives one picture.
load helper

prepare() {
    need_numpy
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$TOP/examples/model
    photo=$TOP/examples/photo.jpg
    dir=$BATS_FILE_TMPDIR
    if [ ! -e "$dir/ready" ]; then
        spid-shape -q "$photo" -o "$dir/me.spid"
        spid-branches -q --bake "$dir/me.spid" -o "$dir/avatar.spid"
        spid-motion -q --no-align --light "$photo" -o "$dir/own.spid"
        touch "$dir/ready"
    fi
    ln -s "$dir"/{me,avatar,own}.spid .
}

# shown OUT [OPTION ...]: the avatar in its own pose.
shown() {
    spid-animate -q -s --absolute -b black "${@:2}" avatar.spid own.spid -o "$1"
}

# measure A.png B.png: the largest difference in levels; then of A over B the mean
# brightness of the cheek on the picture's left and on its right, and both cheeks' red
# over blue.
measure() {
    "$PYTHON" - "$@" <<'PY'
import subprocess
import sys
import numpy as np
a, b = (np.frombuffer(subprocess.run(
    ['ffmpeg', '-v', 'error', '-i', p, '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-'],
    capture_output=True, check=True).stdout, 'u1').reshape(512, 512, 3).astype(int)
        for p in sys.argv[1:])
left, right = (a[270:310, x].mean() / b[270:310, x].mean()
               for x in (slice(195, 225), slice(285, 315)))
cheeks = [p[270:310, [*range(195, 225), *range(285, 315)]].mean((0, 1)) for p in (a, b)]
warm = cheeks[0][0] / cheeks[0][2] / (cheeks[1][0] / cheeks[1][2])
print(abs(a - b).max(), '%.3f %.3f %.3f' % (left, right, warm))
PY
}

# own_light: the photograph's as azimuth, elevation and strength.
own_light() {
    spid-dump --json --values --only MOTN me.spid | "$PYTHON" -c '
import json, sys
import numpy as np
for line in sys.stdin:
    for a in json.loads(line).get("arrays", []):
        if a["name"] == "light":
            x, y, z = a["data"]
s = np.linalg.norm((x, y, z))
print("%.6f,%.6f,%.6f" % (*np.degrees([np.arctan2(x, -z), np.arcsin(-y / s)]), s))'
}

@test "the photograph's own light changes nothing, by name or by its angles" {
    shown none.png
    shown source.png --light source
    cmp none.png source.png
    shown same.png --light "$(own_light)"
    read -r most _ < <(measure same.png none.png)
    [ "$most" -le 1 ] || { echo "off by $most levels"; false; }
    spid-branches -q --bake me.spid --light 90,0,1 -o lit.spid
    spid-animate -q -s --absolute -b black --light source lit.spid own.spid -o back.png
    cmp none.png back.png
}

@test "a lamp brightens the cheek that it is beside" {
    shown none.png
    shown left.png --light -90,0,1
    shown right.png --light 90,0,1
    read -r _ left right _ < <(measure left.png none.png)
    echo "lamp on the left: $left, $right"
    awk "BEGIN { exit !($left > 1.05 && $right < 0.95) }"
    read -r _ left right _ < <(measure right.png none.png)
    echo "lamp on the right: $left, $right"
    awk "BEGIN { exit !($right > 1.05 && $left < 0.95) }"
}

@test "a panorama that is bright on one side is a lamp there" {
    "$PYTHON" - <<'PY'
# Radiance pictures, flat: bright columns on the right of what the camera faces
px = lambda bright: bytes((200, 200, 200, 133 if bright else 128))
with open('right.hdr', 'wb') as f:
    f.write(b'#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 128\n' +
            b''.join(px(80 <= x < 112) for x in range(128)) * 64)
PY
    shown none.png
    shown right.png --light right.hdr
    read -r _ left right _ < <(measure right.png none.png)
    echo "left $left, right $right"
    awk "BEGIN { exit !($right > 1.05 && $left < 0.95) }"
}

@test "a lamp has a colour, at the brightness of a white one" {
    shown white.png --light 60,30,0.8
    shown same.png --light 60,30,0.8,#808080
    cmp white.png same.png
    shown warm.png --light 60,30,0.8,#ffc080
    read -r _ _ _ warm < <(measure warm.png white.png)
    echo "red over blue: $warm"
    awk "BEGIN { exit !($warm > 1.8 && $warm < 2.05) }"
}

@test "baked in, through the pipe and in one process: the same picture" {
    shown one.png --light 60,30,0.8,#ffc080
    spid-branches -q --bake me.spid --light 60,30,0.8,#ffc080 -o lit.spid
    spid-animate -q -s --absolute -b black lit.spid own.spid -o baked.png
    cmp one.png baked.png
    spid-flame -q -i avatar.spid own.spid | spid-branches -i avatar.spid --light 60,30,0.8,#ffc080 >gaus.spid
    spid-splat -q -o pipe.png gaus.spid
    cmp one.png pipe.png
    # the refiner's way, with the colour in FEAT
    spid-animate -q --absolute -b black lit.spid own.spid -o one.png
    spid-splat -q --channels 32 --covered gaus.spid | spid-refine -q -o pipe.png
    cmp one.png pipe.png
}

@test "the driver's light, of its pictures or of its motions" {
    shown records.png --light driver
    spid-animate -q -s --absolute -b black --light driver avatar.spid "$photo" -o clip.png
    cmp records.png clip.png
    spid-flame -q --keep-motion -i avatar.spid own.spid | spid-branches -i avatar.spid --light driver |
        spid-splat -q -o pipe.png
    cmp records.png pipe.png
    spid-motion -q --no-align "$photo" -o dark.spid
    status 65 spid-animate -q --light driver avatar.spid dark.spid -o no.png
    one_line
    has "does not say its light"
}

@test "what is no light is refused in a line" {
    for bad in 90 90,0,2 200,0 0,91 1,2,3,4 , 90, 90,0,#000000 90,0,#12345 '90,0,#ffffff,1'; do
        status 64 spid-animate -q --light "$bad" avatar.spid own.spid -o no.png
        one_line
        has "--light=$bad: not a light (expected AZIMUTH,ELEVATION[,STRENGTH][,#RRGGBB]"
    done
    status 66 spid-animate -q --light nowhere.hdr avatar.spid own.spid -o no.png
    one_line
    has "nowhere.hdr"
    head -c 1000 /dev/urandom >noise.hdr
    status 66 spid-animate -q --light noise.hdr avatar.spid own.spid -o no.png
    one_line
    ffmpeg -v error -f lavfi -i color=gray:s=100x100 -frames:v 1 square.png
    status 65 spid-animate -q --light square.png avatar.spid own.spid -o no.png
    one_line
    has "twice as wide as high"
    status 64 spid-branches -q --bake me.spid --light driver -o no.spid
    one_line
    [ ! -e no.png ] && [ ! -e no.spid ]
}

@test "an avatar that does not know its photograph's light is not relit" {
    PYTHONPATH=$TOP/examples "$PYTHON" - <<'PY'
import spidstream
out = open('unlit.spid', 'wb')
w = spidstream.Writer(out)
for rec in spidstream.read_stream(open('avatar.spid', 'rb')):
    if rec.type == 'END ':
        break
    if rec.type == 'GAUS':
        del rec.arrays['light'], rec.arrays['normal']
    w.write(rec)
w.end()
PY
    spid-animate -q -s --absolute -b black --light source unlit.spid own.spid -o a.png
    status 65 spid-animate -q -s --light 90,0 unlit.spid own.spid -o no.png
    one_line
    has "does not know the light"
}
