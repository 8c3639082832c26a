#!/usr/bin/env bats
# spid-refine: feature images in, finished pictures out.
load helper

setup_file() {
    "$TOP/${BUILD:-build}/tests/unit/track_motion" --model \
        "$BATS_FILE_TMPDIR/model.safetensors"
    export SPID_MODEL=$BATS_FILE_TMPDIR/model.safetensors
}

prepare() {
    need_numpy
    features 64 32
}

# features SIZE CHANNELS [DTYPE]: feat.spid, a soft spot in the middle.
features() {
    "$PYTHON" - "$1" "$2" "${3:-f4}" <<'PY'
import sys
import numpy as np
S, C, t = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
y, x = np.mgrid[0:S, 0:S] / S
a = np.clip(1.5 - 8 * np.hypot(x - .5, y - .5), 0, 1).astype('f4')
f = np.random.default_rng(1).normal(size=(S, S, C)) * .1
f[..., 0], f[..., 1], f[..., 2] = .8, .6 * x, .5 * y
np.save('feat.npy', (f * a[..., None]).astype(t))
np.save('alpha.npy', a)
PY
    spid-pack -t FEAT feat.npy alpha.npy -o feat.spid
}

@test "a feature record becomes a picture, the rest passes" {
    spid-refine feat.spid -o out.spid
    spid-dump --check out.spid
    run spid-dump --json out.spid
    has '"type":"IMAG"'
    has '"shape":[64,64,3]'
    motion 1
    spid-refine motion.spid -o same.spid
    spid-dump --json --only MOTN motion.spid >a
    spid-dump --json --only MOTN same.spid >b
    cmp a b
}

@test "a gain multiplies the picture, one of another size is refused" {
    gain() { # HEIGHT
        "$PYTHON" -c "import sys, numpy; numpy.save('gain.npy',
            numpy.full((int(sys.argv[1]), 16), .5, 'f4'))" "$1"
        spid-pack -t FEAT feat.npy alpha.npy gain.npy -o lit.spid
    }
    gain 16
    spid-refine -q feat.spid -o plain.pam
    spid-refine -q lit.spid -o lit.pam
    "$PYTHON" - <<'PY'
import numpy as np
a, b = (np.frombuffer(open(f, 'rb').read()[-64 * 64 * 3:], 'u1').astype(int)
        for f in ('plain.pam', 'lit.pam'))
print(a.max(), abs(a - 2 * b).max())
assert a.max() > 100 and abs(a - 2 * b).max() <= 2
PY
    gain 8
    status 65 spid-refine -q lit.spid -o other.pam
    one_line
    has "lit.spid: frame 0: FEAT gain is 8 x 16 (expected 16 x 16)"
    "$PYTHON" -c "import numpy as n
for f in ('feat', 'alpha', 'gain'): n.save(f + '.npy', n.load(f + '.npy')[:8 if f == 'gain' else 32])"
    spid-pack -t FEAT feat.npy alpha.npy gain.npy -o wide.spid
    status 65 spid-refine -q wide.spid -o other.pam
    one_line
    has "FEAT of 32 x 64 pixels has gain (expected a square)"
}

@test "half and single precision features give nearly the same picture" {
    spid-refine feat.spid --format pam -o a.pam
    features 64 32 f2
    spid-refine feat.spid --format pam -o b.pam
    "$PYTHON" - <<'PY'
import numpy as np
a, b = (np.fromfile(n, 'u1')[-64 * 64 * 3:].astype(int) for n in ('a.pam', 'b.pam'))
assert abs(a - b).max() <= 1, abs(a - b).max()
PY
}

@test "every format holds the same picture" {
    spid-refine feat.spid -o a.pam
    spid-refine feat.spid -o f-%03d.png
    spid-refine --format pam <feat.spid >b.pam
    cmp a.pam b.pam
    spid-refine feat.spid -o a.exr
    spid-refine feat.spid -o a.y4m
    spid-refine feat.spid -o a.mp4
    [ -s f-000.png ]
    [ -s a.exr ]
    [ -s a.mp4 ]
    head -c 9 a.y4m | grep -q YUV4MPEG2
    [ "$(ls ./*.part* 2>/dev/null | wc -l)" -eq 0 ]
}

@test "pure red stays red through Y4M and ffmpeg" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    "$PYTHON" - <<'PY'
import numpy as np
np.save('feat.npy', np.zeros((128, 128, 32), 'f4'))
np.save('alpha.npy', np.zeros((128, 128), 'f4'))
PY
    spid-pack -t FEAT feat.npy alpha.npy -o feat.spid
    spid-refine --roi -q --background 255,0,0 feat.spid -o red.y4m
    ffmpeg -v error -i red.y4m -vf scale=in_color_matrix=bt709 -f rawvideo \
        -pix_fmt rgb24 red.rgb
    # the last pixel lies outside what --roi refines
    read -r r g b < <(tail -c 3 red.rgb | od -An -tu1)
    [ "$r" -ge 253 ] && [ "$g" -le 2 ] && [ "$b" -le 2 ]
}

@test "the background shows where alpha is 0, or alpha is kept" {
    features 256 32
    spid-refine --roi -q --background '#10c020' feat.spid -o a.pam
    [ "$(tail -c 3 a.pam | od -An -tu1 | xargs)" = "16 192 32" ]
    spid-refine --roi -q --alpha feat.spid -o b.pam
    grep -aq RGB_ALPHA b.pam
    [ "$(tail -c 1 b.pam | od -An -tu1 | xargs)" = 0 ]
    status 64 spid-refine --alpha feat.spid -o c.mp4
    status 64 spid-refine --background source feat.spid -o c.png
    status 66 spid-refine --background nowhere.png feat.spid -o c.png
}

@test "what bf16 and --roi cost is reported" {
    run spid-refine --precision bf16 --roi feat.spid -o a.spid
    [ "$status" -eq 0 ]
    has 'largest error'
    has 'dB against all of it in f32'
}

@test "8 bits: another picture, over 35 dB of f32, and reported" {
    spid-refine --precision int8 feat.spid -o a.spid 2>err
    cat err
    ! grep -q 'no products of 8-bit' err || skip "no products of 8-bit values (a processor with VNNI)"
    spid-refine --precision f32 -q feat.spid -o b.spid
    status 1 cmp -s a.spid b.spid
    sed -n 's/.*int8, .*largest error .*, \([0-9.]*\) dB against all of it in f32.*/\1/p' err >db
    awk '{ n++; if ($1 < 35) exit 1 } END { exit n != 1 }' db
}

@test "8 bits where the processor has none are fast, with a warning" {
    SPID_CPU=avx2 spid-refine --precision int8 feat.spid -o a.spid 2>err
    cat err
    [ "$(grep -c 'no products of 8-bit values on this processor' err)" -eq 1 ]
    no grep -q 'int8, ' err
    SPID_CPU=avx2 spid-refine --precision fast -q feat.spid -o b.spid
    cmp a.spid b.spid
}

@test "8 bits are for refiners alone" {
    status 64 spid-motion --precision int8 feat.spid -o c.spid
    has "int8 is for refiners"
}

@test "one thread and two give the same bits" {
    for p in fast int8; do
        spid-refine -j 1 --precision $p -q feat.spid -o a.spid
        spid-refine -j 2 --precision $p -q feat.spid -o b.spid
        cmp a.spid b.spid
    done
}

@test "features that are not the refiner's are refused" {
    features 64 3
    status 65 spid-refine feat.spid -o out.spid
    one_line
    has 'feat.spid: frame 0: FEAT has 3 channels (expected 32'
    [ ! -e out.spid ]
}

@test "a stream that breaks off keeps the pictures before" {
    cat feat.spid >two.spid
    head -c -64 feat.spid >cut.spid
    status 65 spid-refine cut.spid -o out-%d.png
    [ -s out-0.png ]
    has 'no END record'
}

@test "a size that is no multiple of the network's is refined whole" {
    features 50 32
    spid-refine feat.spid -o a.pam
    grep -aq 'WIDTH 50' a.pam
}

@test "a full disk is noticed" {
    status 74 bash -c 'spid-refine --format pam feat.spid >/dev/full'
}

@test "the turn of the head is received, and must have its six numbers" {
    "$PYTHON" -c "import numpy as np
np.save('turn.npy', np.zeros(6, 'f4'))"
    spid-refine feat.spid -o a.pam
    spid-pack -t FEAT feat.npy alpha.npy turn.npy -o straight.spid
    spid-refine straight.spid -o b.pam
    cmp a.pam b.pam
    "$PYTHON" -c "import numpy as np
np.save('turn.npy', np.array([0, 1, 0, .5, 0, -.5], 'f4'))"
    spid-pack -t FEAT feat.npy alpha.npy turn.npy -o turned.spid
    spid-refine turned.spid -o c.pam
    status 1 cmp -s a.pam c.pam
    "$PYTHON" -c "import numpy as np
np.save('turn.npy', np.zeros(3, 'f4'))"
    spid-pack -t FEAT feat.npy alpha.npy turn.npy -o short.spid
    status 65 spid-refine short.spid -o d.pam
    one_line
    has 'turn'
}

@test "covered pixels alone give the same picture as all of them" {
    features 64 32 f2
    spid-refine feat.spid -o a.pam
    "$PYTHON" - <<'PY'
import numpy as np
f, a = np.load('feat.npy'), np.load('alpha.npy')
np.save('all.npy', f)
np.save('feat.npy', f[a != 0])
PY
    spid-pack -t FEAT feat.npy alpha.npy -o packed.spid
    spid-dump --check packed.spid
    [ "$(stat -c %s packed.spid)" -lt "$(stat -c %s feat.spid)" ]
    spid-refine packed.spid -o b.pam
    cmp a.pam b.pam
    "$PYTHON" -c "import numpy as np
np.save('feat.npy', np.load('feat.npy')[1:])"
    spid-pack -t FEAT feat.npy alpha.npy -o short.spid
    status 65 spid-refine short.spid -o c.pam
    one_line
    has 'as many as alpha covers'
    "$PYTHON" -c "import numpy as np
f = np.load('feat.npy')
np.save('feat.npy', np.concatenate([f, f[:2]]))"
    spid-pack -t FEAT feat.npy alpha.npy -o long.spid
    status 65 spid-refine long.spid -o c.pam
    spid-pack -t FEAT feat.npy -o alone.spid
    status 65 spid-refine alone.spid -o c.pam
}

@test "Y4M in BT.709, or BT.601 where that is asked for" {
    spid-refine -q feat.spid -o plain.pam
    spid-refine -q feat.spid -o hd.y4m
    spid-refine -q --bt601 feat.spid -o sd.y4m
    "$PYTHON" - <<'PY'
import numpy as np
rgb = np.frombuffer(open('plain.pam', 'rb').read()[-64 * 64 * 3:], 'u1')
rgb = rgb.reshape(64, 64, 3) / 255.
for name, kr, kb in (('hd.y4m', .2126, .0722), ('sd.y4m', .299, .114)):
    y4m = open(name, 'rb').read()
    luma = np.frombuffer(y4m[y4m.index(b'FRAME\n') + 6:][:64 * 64], 'u1')
    full = b'XCOLORRANGE=FULL' in y4m[:200]
    y = rgb @ [kr, 1 - kr - kb, kb]
    y = 255 * y if full else 16 + 219 * y
    off = abs(luma.reshape(64, 64) - y).max()
    print(name, off)
    assert off <= 1
PY
}
