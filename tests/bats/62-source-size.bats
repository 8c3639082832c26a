#!/usr/bin/env bats
# The photograph at its own resolution: kept, shown by --size, and with the
# driven head in it.
load helper
load animate

prepare() {
    need_numpy
    animate_files
}

# pixels FILE.png: its RGB bytes as FILE.npy (height, width, 3).
pixels() {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ffmpeg -v error -y -i "$1" -f rawvideo -pix_fmt rgb24 raw
    "$PYTHON" - "$1" "${1%.png}.npy" <<'PY'
import struct
import sys
import numpy as np
w, h = struct.unpack('>II', open(sys.argv[1], 'rb').read()[16:24])
np.save(sys.argv[2], np.fromfile('raw', 'u1').reshape(h, w, 3))
PY
}

# smaller IN OUT SIDE: SRCI's pictures at this side, as older builds kept them.
smaller() {
    PYTHONPATH=$TOP/examples "$PYTHON" - "$@" <<'PY'
import sys
import numpy as np
import spidstream
w = spidstream.Writer(open(sys.argv[2], 'wb'))
n = int(sys.argv[3])
for rec in spidstream.read_stream(open(sys.argv[1], 'rb')):
    if rec.type == 'END ':
        break
    if rec.type == 'SRCI':
        for a in rec.arrays.values():
            if len(a.shape) > 1:
                x = np.frombuffer(bytes(a.data), 'u1').reshape(a.shape)
                at = (np.arange(n) + .5) * a.shape[0] / n
                x = x[at.astype(int)][:, at.astype(int)]
                a.shape, a.data = x.shape, x.tobytes()
    w.write(rec)
w.end()
PY
}

@test "the source's window is kept pixel for pixel, larger than networks see" {
    spid-dump --npy . --only SRCI me.spid
    pixels source.png
    "$PYTHON" - <<'PY'
import numpy as np
rgb, crop = np.load('SRCI.rgb.npy')[0], np.load('SRCI.crop.npy').reshape(3)
photo = np.load('source.npy')
n = len(rgb)
assert n == crop[2] > 128, (n, crop)
left, top = (int(v - crop[2] / 2) for v in crop[:2])
assert left == crop[0] - n / 2 and top == crop[1] - n / 2
y0, y1 = max(0, -top), min(n, 256 - top)
x0, x1 = max(0, -left), min(n, 256 - left)
assert (rgb[y0:y1, x0:x1] == photo[y0 + top:y1 + top, x0 + left:x1 + left]).all()
PY
}

@test "a window of more than 2048 pixels is kept at 2048, a small one as seen" {
    ppm() { printf 'P6 %d %d 255\n' "$1" "$2"; head -c $((3 * $1 * $2)) /dev/zero | tr '\0' "$3"; }
    ppm 300 300 a >small.ppm
    ppm 2400 2400 a >large.ppm
    spid-shape -q -m model --crop 150,150,40 --window 150,150,90 small.ppm -o a.spid
    spid-dump a.spid | grep -q 'u8\[128,128,3\]'
    spid-shape -q -m model --crop 1200,1200,900 --window 1200,1200,2300 \
        --mask large.ppm large.ppm -o b.spid
    spid-dump b.spid | grep -q 'u8\[2048,2048,3\]'
}

@test "of a large photograph as much is kept as its pictures show" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ffmpeg -v error -i source.png -vf scale=768:768 big.png
    spid-shape -q -m model --size 128 big.png -o s.spid
    spid-dump s.spid | grep -q 'u8\[256,256,3\]'
    spid-branches -q -m model --bake s.spid -o a.spid
    spid-animate -q --absolute -m model -s a.spid drive.y4m -o pipe.y4m
    spid-animate -q --absolute -m model -s -b black big.png drive.y4m -o one.y4m
    cmp one.y4m pipe.y4m
    spid-shape -q -m model big.png -o s.spid            # all of it
    spid-branches -q -m model --bake s.spid -o a.spid
    spid-animate -q --absolute -m model -s --size 512 a.spid drive.y4m -o pipe.y4m
    spid-animate -q --absolute -m model -s --size 512 -b black big.png drive.y4m -o one.y4m
    cmp one.y4m pipe.y4m
}

@test "--size: one process and the pipe give the same bytes" {
    set -o pipefail
    spid-motion -q -m model drive.y4m | spid-flame -m model -i avatar.spid |
        spid-branches -i avatar.spid >gaus.spid
    spid-animate -q --absolute -m model -s --size 200 avatar.spid drive.y4m -o one.y4m
    spid-splat -q --size 200 gaus.spid -o pipe.y4m
    cmp one.y4m pipe.y4m
    spid-animate -q --absolute -m model --size 200 avatar.spid drive.y4m -o one.y4m
    grep -qa 'W200 H200' one.y4m
    spid-splat -q --size 128 --channels 8 --covered --places gaus.spid -o feat.spid
    spid-dump --check feat.spid
    spid-refine -q -m model --size 200 feat.spid -o pipe.y4m
    cmp one.y4m pipe.y4m
    status 65 spid-refine -q -m model --size 64 feat.spid -o x.y4m
    one_line
    has 'expected a square of at most --size=64'
    [ ! -e x.y4m ]
}

@test "streams whose source picture is of the networks' size are drawn still" {
    smaller me.spid old.spid 128
    spid-dump --check old.spid
    spid-branches -q -m model --bake old.spid -o old-avatar.spid
    spid-animate -q --absolute -m model -s old-avatar.spid drive.y4m -o a.y4m
    spid-animate -q --absolute -m model --size 256 old-avatar.spid drive.y4m -o b.y4m
    smaller me.spid tiny.spid 100
    status 65 spid-branches -q -m model --bake tiny.spid -o x.spid
    one_line
    has 'source picture is 100 pixels wide (expected 128 to 2048)'
}

@test "--size shows the photograph's detail, --into-source leaves it alone" {
    unset SPID_MODEL
    spid-synth -q -n 1 -s 32 --effects 0 --size 1024 --head "$HEAD" -o whole.png
    ffmpeg -v error -i whole.png -vf crop=900:1000:70:0 own.png
    export SPID_MODEL=$TOP/examples/model
    spid-shape -q --head "$HEAD" own.png -o own.spid
    spid-dump --npy . --only SRCI own.spid
    n=$("$PYTHON" -c "import numpy as np; print(len(np.load('SRCI.rgb.npy')[0]))")
    spid-animate -q --head "$HEAD" -b source own.spid own.png -o small.png
    spid-animate -q --head "$HEAD" -b source --size "$n" own.spid own.png -o large.png
    spid-animate -q --head "$HEAD" --into-source own.png own.png -o into.png
    spid-animate -q --head "$HEAD" --cut -b source own.png own.png -o cut.png
    ffmpeg -v error -i small.png -vf "scale=$n:$n:flags=bicubic" blown.png
    for f in own large blown into cut; do pixels $f.png; done
    "$PYTHON" - <<'PY'
import numpy as np
load = lambda f: np.load(f)[0] if f.startswith('SRCI') else np.load(f)
rgb, matte = load('SRCI.rgb.npy').astype(int), load('SRCI.matte.npy')
crop, own = load('SRCI.crop.npy').reshape(3), np.load('own.npy').astype(int)
db = lambda d: 10 * np.log10(255**2 / max((d**2).mean(), 1e-9))
def detail(a):      # Laplacian of the grey picture, inside the person
    a = a.mean(2)
    a = 4 * a[1:-1, 1:-1] - a[:-2, 1:-1] - a[2:, 1:-1] - a[1:-1, :-2] - a[1:-1, 2:]
    return a[matte[1:-1, 1:-1] == 255]
want = detail(rgb)
blown, large = (1 - ((detail(np.load(f + '.npy')) - want)**2).mean() / (want**2).mean()
                for f in ('blown', 'large'))
print('detail of the photograph: blown up %.2f, --size %.2f' % (blown, large))
assert blown < 0.5 and large > 0.85
into = np.load('into.npy').astype(int)
assert into.shape == own.shape
n = len(rgb)
left, top = (int(v - n / 2) for v in crop[:2])
head = np.zeros(own.shape[:2], bool)
y, x = np.nonzero(matte)
y, x = y + top, x + left
ok = (y >= 0) & (x >= 0) & (y < head.shape[0]) & (x < head.shape[1])
head[y[ok], x[ok]] = True
print('outside %.1f dB, inside %.1f dB' % (db((into - own)[~head]), db((into - own)[head])))
assert db((into - own)[~head]) >= 40 and db((into - own)[head]) >= 33
off = 100 * (abs(into - own)[~head] > 2).mean()
print('off by over 2 levels outside: %.2f %%' % off)
assert off <= 1
cut = np.load('cut.npy')
want = [min(n, s - o) - max(0, -o) for s, o in zip(own.shape, (top, left))]
assert all(abs(c - w * 512 / n) <= 2 for c, w in zip(cut.shape, want)), (cut.shape, want)
PY
}

@test "an identity has no whole photograph: refused in one line" {
    for option in --into-source --cut; do
        status 65 spid-animate -q -m model -s $option avatar.spid drive.y4m -o x.y4m
        one_line
        has "expected a picture as SOURCE with $option"
        [ ! -e x.y4m ]
    done
}
