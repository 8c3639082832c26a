#!/usr/bin/env bats
# spid-shape: a picture in, an identity out.
load helper

setup_file() {
    "$TOP/${BUILD:-build}/tests/unit/track_motion" --model \
        "$BATS_FILE_TMPDIR/model.safetensors"
    export SPID_MODEL=$BATS_FILE_TMPDIR/model.safetensors
}

# picture KIND W H BYTE: a PAM of one value, KIND RGB or RGB_ALPHA.
picture() {
    local depth=3
    [ "$1" = RGB ] || depth=4
    printf 'P7\nWIDTH %d\nHEIGHT %d\nDEPTH %d\nMAXVAL 255\nTUPLTYPE %s\n' \
        "$2" "$3" "$depth" "$1"
    printf 'ENDHDR\n'
    yes "$4" | tr -d '\n' | head -c $(($2 * $3 * depth))
}

# ppm W H BYTE
ppm() {
    printf 'P6 %d %d 255\n' "$1" "$2"
    yes "$3" | tr -d '\n' | head -c $((3 * $1 * $2))
}

crop=--crop=50,40,30

@test "an identity is CONF, SRCI, SHAP, MOTN and END" {
    ppm 100 80 abcdefg >me.ppm
    ppm 100 80 '~' >mask.ppm
    spid-shape $crop --mask mask.ppm me.ppm -o me.spid
    spid-dump --check me.spid
    run spid-dump --json me.spid
    types=$(grep -o '"type":"[A-Z]*"' <<<"$output" | cut -d'"' -f4)
    [ "$(echo $types)" = "CONF SRCI SHAP MOTN" ]
    has '"shape":[512,512,3]'
    has head_hash
}

@test "a picture cut short is used, with a warning" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ppm 100 80 abcdefg >me.ppm
    ppm 100 80 '~' >mask.ppm
    ffmpeg -v error -i me.ppm me.jpg
    head -c $(($(stat -c %s me.jpg) * 2 / 3)) me.jpg >cut.jpg
    status 0 spid-shape $crop --mask mask.ppm me.jpg -o me.spid
    [ -z "$output" ]
    status 0 spid-shape $crop --mask mask.ppm cut.jpg -o me.spid
    one_line
    has "cut.jpg: the picture is damaged or cut short"
    status 0 spid-motion $crop me.jpg cut.jpg cut.jpg -o motion.spid
    has "2 pictures damaged or cut short"
}

@test "the matte is the mask where the picture is, and goes on beyond its edges" {
    need_numpy
    ppm 100 80 abcdefg >me.ppm
    printf 'P5 100 80 255\n' >mask.pgm
    head -c 8000 /dev/zero | tr '\0' '\377' >>mask.pgm
    spid-shape $crop --window 50,40,160 --mask mask.pgm me.ppm -o me.spid
    spid-dump --npy . --only SRCI me.spid
    "$PYTHON" - <<'PY'
import numpy as np
m = np.load('SRCI.matte.npy').reshape(512, 512)
# 100 x 80 of 160 x 160 pixels are inside
x, y = (30 * 3.2, 130 * 3.2), (40 * 3.2, 120 * 3.2)
left, right, top, bottom = int(x[0]) + 4, int(x[1]) - 4, int(y[0]) + 4, int(y[1]) - 4
assert (m[top:bottom, left:right] == 255).all()
# below the picture a body goes on, as the head's place tells, and above its top
# corners there is nobody
assert (m[bottom + 8:, 230:280] > 128).all()
assert (m[:60, :40] < 64).all() and (m[:60, -40:] < 64).all()
PY
}

@test "a mask the wrong way round is refused" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    photo=$TOP/examples/photo.jpg
    for inside in 255 0; do         # an ellipse about the face
        ffmpeg -v error -y -i "$photo" -frames:v 1 -vf "format=gray,geq=lum='\
            if(lt(hypot((X-384)/200,(Y-480)/300),1),$inside,255-$inside)'" mask$inside.png
    done
    status 0 spid-shape -q -m "$TOP/examples/model" --mask mask255.png "$photo" -o right.spid
    status 65 spid-shape -q -m "$TOP/examples/model" --mask mask0.png "$photo" -o wrong.spid
    one_line
    has 'the mask file shows nobody where the face is'
    [ ! -e wrong.spid ]
}

@test "a mask of another size is refused" {
    ppm 100 80 abcdefg >me.ppm
    ppm 50 80 a >mask.ppm
    status 65 spid-shape $crop --mask mask.ppm me.ppm -o me.spid
    one_line
    has 'mask of 50 x 80 pixels (expected 100 x 80, as the picture)'
}

@test "the same picture gives the same bytes, whatever the threads" {
    ppm 100 80 'a quick brown fox' >me.ppm
    spid-shape -q $crop -j 1 me.ppm -o a.spid
    spid-shape -q $crop -j 2 me.ppm -o b.spid
    cmp a.spid b.spid
}

@test "the overlay is a PNG of the picture's size" {
    ppm 100 80 'a quick brown fox' >me.ppm
    spid-shape $crop --mask me.ppm me.ppm -o me.spid --overlay seen.png
    [ "$(head -c 4 seen.png | tail -c 3)" = PNG ]
    [ "$(od -An -tu1 -j16 -N8 seen.png | xargs)" = "0 0 0 100 0 0 0 80" ]
}

@test "a video is no photograph" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ffmpeg -v error -f lavfi -i testsrc=s=360x288:d=0.1 -pix_fmt yuv420p clip.mp4
    status 65 spid-shape clip.mp4 -o x.spid
    one_line
    has 'clip.mp4: a video (expected a picture'
    [ ! -e x.spid ]
}

@test "pictures that cannot be are refused in one line" {
    ppm 1 1 abc >dot.ppm
    status 65 spid-shape $crop dot.ppm -o x.spid
    one_line
    has '1 x 1 pixels (expected at least 16 x 16)'
    printf 'P6 20000 20000 255\n' >huge.ppm
    status 65 spid-shape $crop huge.ppm -o x.spid
    one_line
    ppm 64 64 x >flat.ppm
    status 65 spid-shape flat.ppm -o x.spid
    one_line
    has 'no face'
    has '--crop X,Y,SIZE'
    status 65 spid-shape --crop 900,0,10 flat.ppm -o x.spid
    one_line
    has 'flat.ppm: --crop is beyond 64x64'
    : >empty.png
    status 65 spid-shape $crop empty.png -o x.spid
    status 66 spid-shape $crop missing.png -o x.spid
    status 64 spid-shape $crop -o x.spid
    [ ! -e x.spid ]
}

@test "a made person is found, and its matte is about what was drawn" {
    spid-synth -q --size 512 --effects 0 -s 31 --without mesh -o true.spid
    spid-synth -q --size 512 --effects 0 -s 31 --format png -o me.png
    spid-shape me.png -o me.spid --window 256,256,512
    mean() {
        spid-dump --json --only "$2" "$1" | grep -o "\"name\":\"$3\"[^}]*" |
            grep -o '"mean":[0-9.]*' | cut -d: -f2
    }
    a=$(mean me.spid SRCI matte)
    b=$(mean true.spid IMAG mask)
    echo "matte $a, true mask $b (of 255)"
    awk -v a="$a" -v b="$b" \
        'BEGIN { if (b <= 1) b *= 255; exit !(a > .75 * b && a < 1.3 * b) }'
}

@test "shoulders that leave the picture below go on to the window's edge" {
    need_numpy
    spid-synth -q --size 512 --effects 0 -s 7 --format png -o whole.png
    ffmpeg -v error -i whole.png -vf crop=512:430:0:0 me.png
    spid-shape me.png -o me.spid --window 256,256,512
    spid-dump --npy . --only SRCI me.spid
    "$PYTHON" - <<'PY'
import numpy as np
m = np.load('SRCI.matte.npy').reshape(512, 512)
c = np.load('SRCI.rgb.npy').reshape(512, 512, 3).astype(int)
below, edge = m[430:] > 200, m[425] > 200
wide = below.sum(1)
print(edge.sum(), wide, c[430:][below].sum(1).min())
assert edge.sum() > 200
# a body about as wide as it left the picture
assert (np.abs(wide - edge.sum()) < 0.4 * edge.sum()).all()
# as the edge has it, not the black of what is not there
mean = lambda part, who: part[who].mean(0)
assert mean(c[430:], below).sum() > 0.4 * mean(c[425], edge).sum()
PY
}

@test "a matte network in the model says who is in front" {
    need_numpy
    mkdir model
    cp "$TOP/examples/model/head.safetensors" model/
    # one that takes what is brighter than 0.55 for the person
    "$PYTHON" - "$TOP/examples/model/model.safetensors" <<'PY'
import json, struct, sys
import numpy as np
data = open(sys.argv[1], 'rb').read()
n, = struct.unpack_from('<Q', data)
head, body = json.loads(data[8:8 + n]), data[8 + n:]
width = [4, 6, 12, 16, 16]
net = {}
for i in range(5):
    into = width[i - 1] if i else 12
    net['down.%d' % i] = np.zeros((width[i], into, 3, 3), np.float32)
    if i:
        net['same.%d' % i] = np.zeros((width[i], width[i], 3, 3), np.float32)
    if i < 4:
        out = width[i - 1] if i else 4
        net['up.%d' % i] = np.zeros((out, width[i], 3, 3), np.float32)
net['down.0'][0, :, 1, 1] = 1 / 48
net['up.0'][:, 0, 1, 1] = 100
for name, w in net.items():
    bias = np.zeros(len(w), np.float32) - (10 if name == 'up.0' else 0)
    for part, x in (('weight', w), ('bias', bias)):
        at = len(body)
        body += x.tobytes()
        head['matte.%s.%s' % (name, part)] = {
            'dtype': 'F32', 'shape': x.shape,
            'data_offsets': [at, len(body)]}
head = {k: head[k] for k in head if not k.startswith('matte.')
        or k.split('.', 1)[1].rsplit('.', 1)[0] in net}
text = json.dumps(head).encode()
text += b' ' * (-len(text) % 8)
open('model/model.safetensors', 'wb').write(
    struct.pack('<Q', len(text)) + text + body)
PY
    spid-shape -q -m model "$TOP/examples/photo.jpg" -o net.spid
    spid-dump -q --npy . -o /dev/null --only SRCI net.spid
    "$PYTHON" - <<'PY'
import numpy as np
m = np.load('SRCI.matte.npy')[0] / 255
y = np.load('SRCI.rgb.npy')[0].reshape(m.shape + (3,)).mean(2) / 255
n = len(m)
part = np.s_[n // 10:n // 2, n // 4:3 * n // 4]
m, y = m[part], y[part]
bright, dark = m[y > 0.65].mean(), m[y < 0.3].mean()
print('of bright pixels %.2f is person, of dark ones %.2f' % (bright, dark))
assert bright > 0.9 and dark < 0.25
PY
}
