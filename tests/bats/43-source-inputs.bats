#!/usr/bin/env bats
# Photographs of every kind: read as a person sees them, or refused in a line.
load helper
load animate

prepare() {
    need_numpy
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    animate_files
    crop=--crop=128,128,110
}

# identity PICTURE: its source crop as rgb.npy and matte.npy.
identity() {
    spid-shape -q -m model $crop "$1" -o me2.spid
    spid-dump --npy . --only SRCI me2.spid
}

# alike TOLERANCE WHAT: the crop is the upright picture's, on average.
alike() {
    "$PYTHON" - "$@" <<'PY'
import sys
import numpy as np
a, b = (np.load(f).astype(float).reshape(-1) for f in ('SRCI.rgb.npy', 'plain.npy'))
if sys.argv[2] == 'grey':
    b = (b.reshape(-1, 3) @ [.299, .587, .114]).repeat(3)
assert a.shape == b.shape, (a.shape, b.shape)
off = abs(a - b).mean()
print(sys.argv[2], '%.2f levels' % off)
assert off < float(sys.argv[1])
PY
}

plain() {
    identity source.png
    mv SRCI.rgb.npy plain.npy
}

@test "grey and 16-bit pictures" {
    plain
    ffmpeg -v error -i source.png -pix_fmt gray grey.png
    identity grey.png
    alike 1.5 grey
    for kind in png tiff; do
        ffmpeg -v error -i source.png -pix_fmt rgb48 deep.$kind
        identity deep.$kind
        alike 1.5 "16 bits, $kind"
    done
}

@test "photograph and clip may want a library each" {
    ffmpeg -v error -i source.png source.tiff
    ffmpeg -v error -i drive.y4m drive.mp4
    spid-animate -q -m model -s $crop source.tiff drive.mp4 -o out.mp4
    [ -s out.mp4 ]
}

@test "a photograph that its camera held on its side is upright" {
    plain
    ffmpeg -v error -i source.png -vf transpose=2 -q:v 1 -pix_fmt yuvj444p side.jpg
    # EXIF with one entry: Orientation 6, a quarter turn to the right
    "$PYTHON" - <<'PY'
import struct
tiff = b'MM\0*\0\0\0\x08\0\x01' + struct.pack('>HHIHH', 0x112, 3, 1, 6, 0) + b'\0' * 4
app = b'Exif\0\0' + tiff
raw = open('side.jpg', 'rb').read()
open('turned.jpg', 'wb').write(raw[:2] + b'\xff\xe1' + struct.pack('>H', len(app) + 2) + app + raw[2:])
PY
    identity turned.jpg
    alike 3 turned
    identity side.jpg
    run alike 3 "as stored"
    [ "$status" -ne 0 ]
}

@test "a picture's own alpha is the matte" {
    ffmpeg -v error -i source.png -f lavfi -i color=white:s=256x256 -filter_complex \
        "[1]geq=lum='255*lt(hypot(X-128,Y-150),90)',format=gray[m];[0][m]alphamerge" \
        -pix_fmt rgba -frames:v 1 cut.png
    identity cut.png
    "$PYTHON" - <<'PY'
import numpy as np
m, crop = np.load('SRCI.matte.npy')[0], np.load('SRCI.crop.npy').reshape(3)
n = len(m)
y, x = np.mgrid[:n, :n] + .5
k = crop[2] / n
far = np.hypot(x * k + crop[0] - crop[2] / 2 - 128, y * k + crop[1] - crop[2] / 2 - 150)
assert (m[far < 87] > 250).all() and (m[(far > 93) & (y * k + crop[1] - crop[2] / 2 < 256)] < 5).all()
PY
}

@test "of an animation the first picture counts" {
    plain
    turn="hue=h=n*120"
    ffmpeg -v error -loop 1 -t 0.12 -i source.png -vf \
        "$turn,split[a][b];[a]palettegen[p];[b][p]paletteuse" a.gif
    ffmpeg -v error -loop 1 -t 0.12 -i source.png -vf "$turn" -f apng a.png
    for f in a.gif a.png; do
        identity $f
        alike 8 $f
    done
    ffmpeg -v error -loop 1 -t 0.12 -i source.png -vf "$turn" \
        -c:v libwebp_anim a.webp || skip "ffmpeg has no WebP (apt: ffmpeg)"
    identity a.webp
    alike 8 a.webp
}

@test "a picture smaller than the window, and one of only a face" {
    ffmpeg -v error -i source.png -vf scale=64:64 small.png
    crop=--crop=32,32,28 identity small.png
    ffmpeg -v error -i source.png -vf crop=120:120:68:68 face.png
    crop=--crop=60,60,100 identity face.png
    "$PYTHON" - <<'PY'
import numpy as np
rgb, matte = np.load('SRCI.rgb.npy')[0], np.load('SRCI.matte.npy')[0]
assert rgb.reshape(-1, 3).sum(1).min() > 0, 'black where the picture ends'
PY
    status 0 spid-animate -q -m model -s -b source --crop=32,32,28 small.png drive.y4m -o a.y4m
}

@test "a picture through a pipe is the picture" {
    ffmpeg -v error -i source.png -q:v 1 p.jpg
    ffmpeg -v error -i source.png p.bmp
    for f in source.png p.jpg p.bmp; do
        spid-shape -q -m model $crop $f -o file.spid
        cat $f | spid-shape -q -m model $crop - -o pipe.spid
        cmp file.spid pipe.spid
        spid-shape -q -m model $crop <(cat $f) -o pipe.spid
        cmp file.spid pipe.spid
    done
    spid-animate -q -m model -s file.spid drive.y4m -o a.y4m
    cat file.spid | spid-animate -q -m model -s - drive.y4m -o b.y4m
    cmp a.y4m b.y4m
    status 65 spid-shape -q -m model - -o x.spid < <(head -c 3000 p.bmp)
    one_line
    has '<stdin>: '
    status 64 spid-animate -q -m model -s - - -o x.y4m </dev/null
    one_line
    TMPDIR=/nowhere status 74 spid-shape -q -m model - -o x.spid <p.bmp
    one_line
    [ ! -e x.spid ]
}

@test "CMYK is refused in one line" {
    "$PYTHON" - <<'PY'
import struct
tags = [(256, 4, 1, 32), (257, 4, 1, 32), (258, 3, 1, 8 << 16), (259, 3, 1, 1 << 16),
        (262, 3, 1, 5 << 16), (273, 4, 1, 200), (277, 3, 1, 4 << 16), (278, 4, 1, 32),
        (279, 4, 1, 4096)]
ifd = struct.pack('>H', len(tags)) + b''.join(struct.pack('>HHII', *t) for t in tags) + b'\0' * 4
raw = b'MM\0*\0\0\0\x08' + ifd
open('ink.tiff', 'wb').write(raw.ljust(200, b'\0') + b'\x40' * 4096)
PY
    status 65 spid-shape -q -m model $crop ink.tiff -o x.spid
    one_line
    has 'CMYK'
    [ ! -e x.spid ]
}

@test "a JPEG picture of a thousand scans is refused in one line" {
    # 8 x 8 pixels, progressive; each scan sends the same empty block again
    "$PYTHON" - <<'PY'
import struct
def segment(marker, data):
    return struct.pack('>BBH', 0xff, marker, len(data) + 2) + data
def table(kind):
    return segment(0xc4, bytes([kind, 1] + 15 * [0] + [0]))
def scan(first, last):
    return segment(0xda, bytes([1, 1, 0, first, last, 0])) + b'\x7f'
with open('scans.jpg', 'wb') as f:
    f.write(b'\xff\xd8' + segment(0xdb, bytes([0] + 64 * [1])) +
            segment(0xc2, bytes([8, 0, 8, 0, 8, 1, 1, 0x11, 0])) +
            table(0x00) + table(0x10) + scan(0, 0) + 999 * scan(1, 63) + b'\xff\xd9')
PY
    status 65 spid-shape -q -m model scans.jpg -o me2.spid
    one_line
    has 'scans.jpg: damaged picture: more than 500 scans'
}
