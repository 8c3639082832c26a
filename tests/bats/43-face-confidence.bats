# How sure the encoder is of a face: turned pictures stand up, false finds are
# refused, motions say so.
load helper

need_sure() {
    MODEL=${SPID_MODEL:-$TOP/examples/model/model.safetensors}
    [ -e "$MODEL" ] || skip "no model shipped (make model)"
    head -c 100000 "$MODEL" | grep -aq 'motion.sure.weight' ||
        skip "the model does not say how sure it is (make model)"
    need_numpy
}

# turned QUARTERS IN OUT: a PAM picture turned anticlockwise, as PPM.
turned() {
    "$PYTHON" - "$@" <<'END'
import sys
import numpy as np
head, _, body = open(sys.argv[2], 'rb').read().partition(b'ENDHDR\n')
size = dict(l.split()[:2] for l in head.decode().splitlines()[1:])
h, w = int(size['HEIGHT']), int(size['WIDTH'])
x = np.rot90(np.frombuffer(body, np.uint8).reshape(h, w, 3), int(sys.argv[1]))
open(sys.argv[3], 'wb').write(b'P6 %d %d 255\n' % x.shape[1::-1] + x.tobytes())
END
}

@test "a picture on its side is turned, and that is said" {
    need_sure
    spid-synth -q -s 3 --effects 0 -o a.pam
    turned 0 a.pam a.ppm
    run spid-shape a.ppm -o a.spid
    [ "$status" -eq 0 ]
    [[ $output != *turned* ]]
    for q in 1 2; do
        turned $q a.pam b.ppm
        run spid-shape b.ppm -o b.spid
        [ "$status" -eq 0 ]
        has "turned by $((90 * q)) degrees clockwise"
    done
    for program in animate live; do
        run "spid-$program" -s b.ppm a.ppm -o b.y4m
        [ "$status" -eq 0 ]
        has "b.ppm: the face lay on its side or upside down: turned by 180"
    done
    cmp <(spid-dump --json --values --only SHAP a.spid) \
        <(spid-dump --json --values --only SHAP b.spid)
}

@test "a person far away in a photograph is found" {
    need_sure
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    # a face of 80 pixels, a seventeenth of the shorter side
    ffmpeg -v error -i "$TOP/examples/photo.jpg" -frames:v 1 \
        -vf scale=200:-1,pad=2100:1400:900:700:gray far.png
    run spid-shape far.png -o far.spid
    [ "$status" -eq 0 ]
    [ -z "$output" ]
    read -r x y size < <(spid-dump --json --values --only MOTN far.spid |
        sed 's/.*"crop"[^]]*][^[]*"data":\[\([0-9.]*\),\([0-9.]*\),\([0-9.]*\).*/\1 \2 \3/')
    echo "$x $y $size in the window"
    window=$(spid-dump --json --values --only SRCI far.spid |
        sed 's/.*"crop"[^]]*][^[]*"data":\[\([0-9.,]*\)].*/\1/')
    awk -F, '{ exit !($1 > 960 && $1 < 1040 && $2 > 780 && $2 < 880 && $3 < 300) }' <<<"$window"
}

# tilted DEGREES IN OUT: a PPM rolled about its middle, edges drawn out.
tilted() {
    "$PYTHON" - "$@" <<'END'
import sys
import numpy as np
head, size, _, body = open(sys.argv[2], 'rb').read().split(b'\n', 3)
a, w, h = np.radians(float(sys.argv[1])), *map(int, size.split())
y, x = np.mgrid[:h, :w] - np.array([h, w]).reshape(2, 1, 1) / 2
u = np.rint(np.cos(a) * x - np.sin(a) * y + w / 2).clip(0, w - 1).astype(int)
v = np.rint(np.sin(a) * x + np.cos(a) * y + h / 2).clip(0, h - 1).astype(int)
picture = np.frombuffer(body, np.uint8).reshape(h, w, 3)[v, u]
open(sys.argv[3], 'wb').write(b'P6 %d %d 255\n' % (w, h) + picture.tobytes())
END
}

@test "a head tilted by 35 degrees either way is found, and as tilted" {
    need_sure
    spid-synth -q -s 3 --effects 0 -o a.pam
    turned 0 a.pam a.ppm
    sed -i '1s/^P6 \([0-9]* [0-9]*\) 255$/P6\n\1\n255/' a.ppm
    spid-shape -q a.ppm -o a.spid
    spid-dump -q --only MOTN --npy a a.spid
    for tilt in -35 35; do
        tilted $tilt a.ppm b.ppm
        spid-shape -q b.ppm -o b.spid
        spid-dump -q --only MOTN --npy b b.spid
        "$PYTHON" - $tilt <<'END'
import sys
import numpy as np
a, b = (np.load(d + '/MOTN.rot.npy').reshape(-1, 3, 3)[0] for d in 'ab')
turn = b @ a.T
roll = np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))
print(f'rolled by {roll:.1f} degrees')
sys.exit(int(abs(abs(roll) - 35) > 8 or roll * float(sys.argv[1]) > 0))
END
        rm -r b
    done
}

@test "a clip that lies on its side or stands on its head is refused, and how it lies said" {
    need_sure
    spid-synth -q -s 3 --effects 0 -o a.pam
    for q in 1 2; do
        turned $q a.pam b.ppm
        status 65 spid-motion b.ppm -o b.spid
        one_line
        has "turned by $((90 * q)) degrees clockwise"
        [ ! -e b.spid ]
    done
}

@test "a clip on its head in which the detector thinks to see a face is refused, too" {
    need_sure
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    take=${SPID_ASSETS:-$TOP/../shared/assets}/clips/lrwp9a.mpg
    [ -e "$take" ] || skip "no assets in ${take%/clips/*} (SPID_ASSETS)"
    ffmpeg -v error -i "$take" -an -frames:v 6 -vf vflip,hflip -c:v libx264 -qp 10 a.mp4
    status 65 spid-motion a.mp4 -o a.spid
    one_line
    has "turned by 180 degrees clockwise"
    [ ! -e a.spid ]
}

@test "heads to the side, above and below are found, in the middle of their window" {
    need_sure
    assets=${SPID_ASSETS:-$TOP/../shared/assets}
    [ -e "$assets/ict" ] || skip "no assets in $assets (SPID_ASSETS)"
    turns=(55 -65 0:35 -30:-35)
    spid-synth -q --assets "$assets" -s 90100 --first 1 -n 2 --frames 4 --fps 0.8 \
        --size 384 --effects 0.6 --without mesh --turn "$(IFS=,; echo "${turns[*]}")" \
        -o people.spid
    spid-dump -q --npy truth -o /dev/null people.spid
    "$PYTHON" -c 'import numpy as np
for i, x in enumerate(np.load("truth/IMAG.rgb.npy")):
    open(f"{i}.ppm", "wb").write(b"P6 %d %d 255\n" % x.shape[1::-1] + x.tobytes())'
    for i in {0..7}; do
        spid-shape -q $i.ppm -o $i.spid
        spid-dump -q --only MOTN,SRCI --npy $i $i.spid
        "$PYTHON" - $i <<'P'
import sys
import numpy as np
a = np.load(f'{sys.argv[1]}/MOTN.rot.npy').reshape(3, 3)
b = np.load('truth/MOTN.rot.npy').reshape(-1, 3, 3)[int(sys.argv[1])]
off = np.degrees(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1)))
t = np.load('truth/MOTN.trans.npy').reshape(-1, 3)[int(sys.argv[1])]
head = np.append(192 + 6 * 384 * t[:2] / t[2], 384 * 11 / t[2])
window = np.load(f'{sys.argv[1]}/SRCI.crop.npy').reshape(3)
beside = abs(window - head) / head[2]
print(f'{sys.argv[1]}: {off:.1f} degrees off, window by', beside.round(3))
sys.exit(int(off > 20 or (beside > [0.05, 0.05, 0.2]).any()))
P
    done
}

@test "motions say how sure the encoder is" {
    need_sure
    spid-synth -q -s 3 --frames 3 --effects 0 -o a.y4m
    spid-motion -q a.y4m -o a.spid
    [ "$(spid-dump --only MOTN a.spid | grep -c '^ *sure')" -eq 3 ]
}

# crop MOTION: of its first frame, pixels of the portrait window.
crop() {
    spid-dump --json --values --only MOTN "$1" | "$PYTHON" -c 'import json, sys
arrays = json.loads(sys.stdin.readline())["arrays"]
print(*next(a["data"] for a in arrays if a["name"] == "crop"))'
}

@test "a face has the same crop wherever the search for it began" {
    need_sure
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ffmpeg -nostdin -v error -i "$TOP/examples/photo.jpg" a.png
    ffmpeg -nostdin -v error -i a.png -vf pad=iw+300:ih+200:211:160:gray b.png
    spid-motion -q --window 500,600,900 a.png -o a.spid
    spid-motion -q --window 711,760,900 b.png -o b.spid
    paste <(crop a.spid) <(crop b.spid) | "$PYTHON" -c 'import sys
x = [float(v) for v in sys.stdin.read().split()]
assert all(abs(a - b) < 0.4 for a, b in zip(x[:3], x[3:])), x'
}

@test "no face in noise: one line, no file" {
    need_sure
    "$PYTHON" -c 'import numpy as np, sys
x = np.random.RandomState(1).randint(0, 256, (24, 24, 3), np.uint8)
x = np.kron(x, np.ones((20, 20, 1), np.uint8))
sys.stdout.buffer.write(b"P6 480 480 255\n" + x.tobytes())' >noise.ppm
    status 65 spid-shape noise.ppm -o x.spid
    one_line
    has "upright and turned"
    [ ! -e x.spid ]
}

@test "a face that the picture's edge cuts is said" {
    need_sure
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ffmpeg -nostdin -v error -i "$TOP/examples/photo.jpg" -vf crop=iw*0.55:ih:0:0 cut.png
    run spid-shape -m "$MODEL" cut.png -o cut.spid
    [ "$status" -eq 0 ]
    has "cut.png: the picture's edge cuts the face ("
    run spid-shape -m "$MODEL" "$TOP/examples/photo.jpg" -o whole.spid
    [ "$status" -eq 0 ]
    [[ $output != *edge* ]]
}

@test "a cut to another person is said" {
    need_sure
    for seed in 3 4; do
        spid-synth -q --frames 2 --size 256 --effects 0 --format pam -s $seed
    done >cut.pam
    run spid-motion cut.pam -o out.spid
    [ "$status" -eq 0 ]
    has 'cut.pam: frame 2: another scene'
    spid-synth -q --frames 4 --size 256 --effects 0 --format pam -s 3 >one.pam
    run spid-motion one.pam -o out.spid
    [ "$status" -eq 0 ]
    [[ $output != *scene* ]]
}
