#!/usr/bin/env bats
# The photograph as texture: a person driven by their own picture is that
# picture, in one process and through the pipe; streams with and without
# places.
load helper
load animate

front=1,0,0,0,0,-1,0,0,0,0,-1,12

prepare() {
    need_numpy
    animate_files
}

# likeness A.png B.npy [MATTE.npy]: PSNR in dB of the whole picture, and with
# a matte, of the pixels where it is 0 the share that is off by more than two
# levels, in per cent.
likeness() {
    "$PYTHON" - "$@" <<'PY'
import subprocess
import sys
import numpy as np
raw = subprocess.run(['ffmpeg', '-v', 'error', '-i', sys.argv[1], '-f', 'rawvideo',
                      '-pix_fmt', 'rgb24', '-'], capture_output=True, check=True).stdout
a = np.frombuffer(raw, 'u1').astype(int)
b = np.load(sys.argv[2]).astype(int).reshape(-1)
off = abs(a - b)
text = '%.2f' % (10 * np.log10(255**2 / max((off**2).mean(), 1e-9)))
if len(sys.argv) > 3:
    out = off.reshape(-1, 3).max(1)[np.load(sys.argv[3]).reshape(-1) == 0]
    text += ' %.3f' % (100 * (out > 2).mean())
print(text)
PY
}

# edit IN OUT: a stream without the arrays of GAUS that are named after them.
edit() {
    PYTHONPATH=$TOP/examples "$PYTHON" - "$@" <<'PY'
import sys
import spidstream
out = open(sys.argv[2], 'wb')
w = spidstream.Writer(out)
for rec in spidstream.read_stream(open(sys.argv[1], 'rb')):
    if rec.type == 'END ':
        break
    for name in sys.argv[3:] if rec.type == 'GAUS' else []:
        del rec.arrays[name]
    w.write(rec)
w.end()
PY
}

# piped AVATAR.spid PICTURES: gaus.spid, the avatar driven by them, stage by
# stage.
piped() {
    set -o pipefail
    spid-motion -q -m model "$2" | spid-flame -m model -i "$1" |
        spid-branches -i "$1" >gaus.spid
}

@test "driven by their own picture, people are that picture" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$TOP/examples/model
    for seed in 1 8; do
        spid-synth -q -n 1 -s $seed --effects 0 --size 512 --head "$HEAD" \
            -o own.png
        spid-shape -q --head "$HEAD" own.png -o own.spid
        spid-dump --npy . --only SRCI own.spid
        side=$(spid-dump own.spid | sed -n 's/^ *matte .*\[\([0-9]*\),.*/\1/p')
        for star in "" -s; do
            spid-animate -q $star --size "$side" --head "$HEAD" -b source own.spid own.png \
                -o a.png
            likeness a.png SRCI.rgb.npy SRCI.matte.npy >like
            echo "$seed $star: $(cat like)"
            # of the background, what lies right beside hair may differ
            awk '{ exit !($1 >= 35 && $2 < 0.02) }' like
        done
    done
}

@test "without the photograph: another picture" {
    spid-animate -q --absolute -m model -s avatar.spid drive.y4m -o photo.y4m
    piped avatar.spid drive.y4m
    spid-splat -q --size 128 --no-photo gaus.spid -o pipe.y4m
    status 1 cmp -s photo.y4m pipe.y4m
    spid-splat -q --size 128 gaus.spid -o pipe.y4m
    cmp photo.y4m pipe.y4m
    # a refiner gets the photograph beside its features
    spid-splat -q --size 128 --channels 8 gaus.spid -o feat.spid
    spid-dump --check feat.spid
    spid-dump --json --only FEAT feat.spid >json
    grep -q '"name":"photo"' json
    spid-splat -q --size 128 --channels 8 --no-photo gaus.spid -o plain.spid
    spid-dump --json --only FEAT plain.spid >json
    status 1 grep -q '"name":"photo"' json
    spid-animate -q --absolute -m model avatar.spid drive.y4m -o photo.y4m
    spid-refine -q -m model feat.spid -o pipe.y4m
    cmp photo.y4m pipe.y4m
}

@test "streams without places are drawn as without the photograph" {
    # without the source's camera shoulders do not stay before it: none bend
    edit avatar.spid old.spid uv seen view bend
    edit avatar.spid stiff.spid bend
    spid-dump --check old.spid
    spid-animate -q --absolute -m model -s old.spid drive.y4m -o old.y4m
    piped stiff.spid drive.y4m
    spid-splat -q --size 128 --no-photo gaus.spid -o none.y4m
    cmp old.y4m none.y4m
    piped old.spid drive.y4m
    spid-splat -q --size 128 gaus.spid -o pipe.y4m
    cmp old.y4m pipe.y4m
}

@test "places without how far they were seen are refused in one line" {
    edit avatar.spid a.spid seen
    status 65 spid-animate -q -m model -s a.spid drive.y4m -o a.y4m
    one_line
    has 'a.spid: frame 0: GAUS has uv without seen'
    status 65 spid-splat -q --camera $front a.spid -o a.png
    one_line
    has 'GAUS has uv without seen'
    edit avatar.spid a.spid uv
    status 65 spid-splat -q --camera $front a.spid -o a.png
    has 'GAUS has seen without uv'
    edit avatar.spid a.spid view
    status 65 spid-splat -q --camera $front a.spid -o a.png
    has 'GAUS has uv without view'
    [ ! -e a.y4m ] && [ ! -e a.png ]
}

# moved ME.spid lid|jaw ANGLE...: its own motion with the lids closed or the jaw
# dropped so far, a frame each.
moved() {
    PYTHONPATH=$TOP/examples "$PYTHON" - "$@" <<'PY'
import struct
import sys
import spidstream
w = spidstream.Writer(sys.stdout.buffer)
for rec in spidstream.read_stream(open(sys.argv[1], 'rb')):
    if rec.type == 'CONF':
        w.write(rec)
    if rec.type == 'MOTN':
        for rec.frame, x in enumerate(map(float, sys.argv[3:])):
            both = (x, x) if sys.argv[2] == 'lid' else (x, 0, 0)
            rec.arrays[sys.argv[2]].data = struct.pack('<%df' % len(both), *both)
            w.write(rec)
w.end()
PY
}

# posed lid|jaw ANGLE...: own.spid, baked (baked.spid), in its own pose but for
# these: mesh.spid, gaus.spid and, drawn, star.y4m.
posed() {
    spid-branches -q --bake own.spid -o baked.spid
    moved own.spid "$@" >posed.spid
    spid-flame -q -i baked.spid posed.spid -o mesh.spid
    spid-branches -q -i baked.spid mesh.spid -o gaus.spid
    spid-splat -q gaus.spid -o star.y4m
}

# refined: gaus.spid drawn and refined, refined.y4m.
refined() {
    set -o pipefail
    spid-splat -q --channels 32 gaus.spid | spid-refine -q -o refined.y4m
}

# mouths MESH.spid PICTURES.y4m: a line a frame, what is between the lips in the
# middle.  Teeth: the row of the upper third that is least red, how bright it is in
# green, and how red, (R - G) / R; how red the middle is; the darkest row.  Brightness
# in per cent of the chin's mean.  Lips' own rows reach two pixels in.
mouths() {
    rm -rf mesh && spid-dump --npy mesh --only MESH "$1"
    PYTHONPATH=$BATS_TEST_DIRNAME "$PYTHON" - "$TOP/examples/model/head.safetensors" "$2" <<'PY'
import sys
import faces
pictures = faces.pictures(sys.argv[2], 'rgb24')[..., :2].astype(float)
for mark, frame in zip(faces.landmarks(sys.argv[1]), pictures):
    x, y = mark.T
    middle = slice(round(x[61]), round(x[63]))
    rows = frame[round(y[62]) + 2:round(y[66]) - 2, middle].mean(1)
    chin = frame[round(0.5 * (y[57] + y[8])):round(y[8]), middle, 1].mean()
    red = 100 * (1 - rows[:, 1] / rows[:, 0])
    teeth = red[:(len(red) + 2) // 3].argmin()
    print('%.0f %.0f %.0f %.0f' % (100 * rows[teeth, 1] / chin, red[teeth],
                                   red[len(red) // 2], 100 * rows[:, 1].min() / chin))
PY
}

# contrast MESH.spid PICTURES.y4m: a line a frame, the range of brightness (5 to
# 95 %) between the corners of either eye, where they are in the first frame, above
# the lashes of a closed lid.
contrast() {
    rm -rf mesh && spid-dump --npy mesh --only MESH "$1"
    PYTHONPATH=$BATS_TEST_DIRNAME "$PYTHON" - "$TOP/examples/model/head.safetensors" "$2" <<'PY'
import sys
import numpy as np
import faces
mark = faces.landmarks(sys.argv[1])[0]
for frame in faces.pictures(sys.argv[2], 'gray'):
    line = []
    for eye in mark[36:42], mark[42:48]:
        (x0, y0), (x1, y1) = eye.min(0), eye.max(0)
        x0, x1 = 0.75 * x0 + 0.25 * x1, 0.25 * x0 + 0.75 * x1
        box = frame[round(y0):round(0.25 * y0 + 0.75 * y1), round(x0):round(x1)]
        line.append(np.percentile(box, 95) - np.percentile(box, 5))
    print('%.0f %.0f' % tuple(line))
PY
}

# contrasts CONDITION: holds of two frames' eyes, a and b in the first, $1 and
# $2 in the second, as drawn and as refined.
contrasts() {
    local pictures
    for pictures in star refined; do
        contrast mesh.spid $pictures.y4m >range
        cat range
        awk 'NR == 1 { a = $1; b = $2 } END { exit !(NR == 2 && '"$1"') }' range
    done
}

@test "closed lids are skin: neither pupil nor white shows through" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$TOP/examples/model
    spid-shape -q "$TOP/examples/photo.jpg" -o own.spid
    posed lid 0 1
    refined
    contrasts 'a > 100 && b > 100 && $1 < a / 4 && $2 < b / 4'
    # whole sets say how far each is still seen
    spid-branches -q --full -i baked.spid mesh.spid | spid-splat -q -o full.y4m
    cmp star.y4m full.y4m
}

@test "a dropped jaw shows lit teeth, and no black hole" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$TOP/examples/model
    # rows of the mouth as high as when the bounds were found
    spid-shape -q --window 410,486,788 "$TOP/examples/photo.jpg" -o own.spid
    posed jaw 0.15 0.2 0.25
    mouths mesh.spid star.y4m >mouths
    cat mouths
    # without teeth the lip's shade is 35 red; without a mouth the middle is 30
    awk '$1 < 40 || $2 > 30 || $3 < 45 || $4 < 15 { bad = 1 }
         END { exit bad || NR != 3 }' mouths
}

@test "a dropped jaw leaves neither notch nor spur beside the neck" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$TOP/examples/model
    spid-shape -q "$TOP/examples/photo.jpg" -o own.spid
    posed jaw 0 0.35
    spid-splat -q --channels 32 gaus.spid |
        spid-dump --npy feat --only FEAT
    spid-dump -q --npy mesh --only MESH mesh.spid
    # cheeks grow narrow as it drops: what the mesh leaves by 3 pixels is no notch;
    # what it comes to, give or take an outline's two pixels, no spur
    PYTHONPATH=$TOP/examples "$PYTHON" - >pixels <<'PY'
import meshview
import numpy as np
alpha = np.load('feat/FEAT.alpha.npy')
side = alpha.shape[-1]
rest, dropped = alpha.reshape(2, side, side).astype(float)
verts, faces, cam = (np.load('mesh/MESH.%s.npy' % name)[-1]
                     for name in ('verts', 'faces', 'cam'))
points = meshview.surface(verts, faces.reshape(-1, 3), (np.arange(9) + .5) / 9)
mesh = np.zeros(side * side, bool)
mesh[meshview.project(points, cam.reshape(3, 4), side)[0]] = True
near = [mesh.reshape(side, side)]
for _ in range(3):
    near.append(near[-1] | np.any([np.roll(near[-1], by, axis) for by in (1, -1)
                                   for axis in (0, 1)], 0))
lost = (rest > 0.9) & (dropped < 0.5)
gained = (rest < 0.1) & (dropped > 0.5)
print((lost & (near[0] | ~near[3])).sum(), (gained & ~near[2]).sum())
PY
    cat pixels
    awk '{ exit !($1 <= 8 && $2 <= 8) }' pixels
}

@test "eyes that the photograph shows shut open onto iris and white" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$TOP/examples/model
    spid-synth -q --first 1 -s 20 --frames 21 --fps 12 --effects 0 \
        --head "$HEAD" -o blink%d.png
    spid-shape -q --head "$HEAD" blink20.png -o own.spid
    posed lid 0 1
    refined
    contrasts 'a > 1.5 * $1 && b > 1.5 * $2'
}

@test "twice the focal length shows the middle, the photograph too" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    piped avatar.spid source.png
    spid-splat -q --size 256 gaus.spid -o whole.png
    spid-splat -q --size 128 --focal 24 gaus.spid -o near.png
    ffmpeg -v error -i whole.png -vf crop=128:128:64:64 -f rawvideo \
        -pix_fmt rgb24 middle
    "$PYTHON" -c "import numpy as np
np.save('middle.npy', np.fromfile('middle', 'u1'))"
    likeness near.png middle.npy >like
    cat like
    awk '{ exit !($1 > 45) }' like
}

@test "a source picture of one pixel is refused in one line" {
    PYTHONPATH=$TOP/examples "$PYTHON" - <<'PY'
import spidstream
w = spidstream.Writer(open('dot.spid', 'wb'))
for rec in spidstream.read_stream(open('avatar.spid', 'rb')):
    if rec.type == 'END ':
        break
    if rec.type == 'SRCI':
        for name, a in list(rec.arrays.items()):
            if a.shape[:1] != (3,):
                a.shape = (1, 1) + a.shape[2:]
                a.data = bytes(3 if len(a.shape) == 3 else 1)
    w.write(rec)
w.end()
PY
    status 65 spid-animate -q -m model -s dot.spid drive.y4m -o a.y4m
    one_line
    has '1 x 1 pixels (expected at least 2 x 2)'
    status 65 spid-splat -q --camera $front dot.spid -o a.png
    one_line
}
