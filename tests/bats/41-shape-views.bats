#!/usr/bin/env bats
# spid-shape with several pictures: what one does not show, another does.
load helper

window=--window=256,256,512

# A made person turned 40 degrees to one side, 40 and 25 to the other, and one more.
setup_file() {
    cd "$BATS_FILE_TMPDIR"
    spid-synth -q --size 512 --effects 0 -s 31 --frames 3 --fps 1000 \
        --turn 40,-40,-25 --without mesh -o me%d.png
    spid-synth -q --size 512 --effects 0 -s 12 --without mesh -o other%d.png
    spid-shape -q $window me0.png -o one.spid
    spid-shape $window me0.png me1.png -o two.spid 2>two.txt
    spid-branches -q --bake two.spid -o two.avatar
}

prepare() {
    ln -s "$BATS_FILE_TMPDIR"/* .
}

# still IDENTITY: as it is at 25 degrees to the side that its first picture hides.
still() {
    spid-motion -q $window me2.png -o turned.spid
    spid animate -q --absolute --star "$1" turned.spid -o "${1%.spid}%d.png"
}

# squares A B: mean square between two pictures on the cheek that me0 hides.
squares() {
    ffmpeg -v error -i "$1" -f rawvideo -pix_fmt rgb24 -y a.raw
    ffmpeg -v error -i "$2" -f rawvideo -pix_fmt rgb24 -y b.raw
    "$PYTHON" - <<'PY'
import numpy as np
a, b = (np.fromfile(f, np.uint8).reshape(512, 512, 3) / 255. for f in ('a.raw', 'b.raw'))
print(((a - b)[200:330, 210:300] ** 2).mean())
PY
}

@test "a second picture shows the side that the first one hides" {
    need_numpy
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    still one.spid
    still two.spid
    one=$(squares one0.png me2.png)
    two=$(squares two0.png me2.png)
    echo "one picture $one, two $two"
    awk -v a="$one" -v b="$two" 'BEGIN { exit !(b < 0.7 * a) }'
}

@test "the stream holds a further picture as one more SRCI, with its motion" {
    grep -q "me1.png: 1 picture" two.txt
    spid-dump --check two.avatar
    [ "$(spid-dump --json two.avatar | grep -o '"type":"[A-Z]*"' | cut -d'"' -f4 | xargs)" = \
        "CONF SRCI SHAP MOTN SRCI SHAP GAUS" ]
    python3 "$TOP/examples/spidstream.py" <two.avatar >second.json
    [ "$(grep -c '"type": *"SRCI"' second.json)" = 2 ]
    spid-shape -q me1.png -o alone.spid
    rot() {
        spid-dump --json --values --only "$2" "$1" | grep -o '"name":"rot"[^}]*'
    }
    [ -n "$(rot two.spid SRCI)" ]
    [ "$(rot two.spid SRCI)" = "$(rot alone.spid MOTN)" ]
    # what reads the first alone goes on doing so
    spid-export -q two.avatar --html page.html
    spid-export -q two.avatar --ply face.ply
    motion 2
    spid-flame -i two.avatar motion.spid | spid-branches -i two.avatar |
        spid-splat -q -s 64 -o a%d.png
}

@test "the first picture again changes nothing that is seen" {
    need_numpy
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    # windows of their own, since --window is the first one's alone
    spid-shape -q me0.png -o alone.spid
    spid-shape -q me0.png me0.png -o same.spid
    spid-shape -q me0.png me1.png -o both.spid
    still alone.spid
    still same.spid
    still both.spid
    off=$(squares alone0.png same0.png)
    another=$(squares alone0.png both0.png)
    echo "mean square $off, another picture $another"
    awk -v a="$off" -v b="$another" 'BEGIN { exit !(a < 0.004 * b) }'
}

@test "a stranger is named and left out" {
    status 0 spid-shape $window me0.png other0.png -o three.spid
    one_line
    has "other0.png: another person than in me0.png"
    cmp three.spid one.spid
}

@test "of a clip those frames are taken that show the head turned" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    cp me0.png clip0.png
    cp me0.png clip1.png
    cp me1.png clip2.png
    cp me1.png clip3.png
    ffmpeg -v error -framerate 25 -i clip%d.png -c:v ffv1 clip.mkv
    status 0 spid-shape $window me0.png clip.mkv -o clip.spid
    has "clip.mkv: 1 picture"
    [ "$(spid-dump clip.spid | grep -c '^SRCI')" = 2 ]
    ffmpeg -v error -framerate 25 -start_number 0 -i clip%d.png -frames:v 2 -c:v ffv1 still.mkv
    status 0 spid-shape $window me0.png still.mkv -o still.spid
    has "still.mkv: no frame with the head turned another way"
    cmp still.spid one.spid
}

@test "a further picture that cannot be read, or shows nobody, is named" {
    echo "no picture" >text.jpg
    status 65 spid-shape $window me0.png text.jpg -o x.spid
    one_line
    has text.jpg
    status 66 spid-shape $window me0.png missing.png -o x.spid
    one_line
    has missing.png
    printf 'P6 64 64 255\n' >flat.ppm
    yes x | tr -d '\n' | head -c 12288 >>flat.ppm
    status 65 spid-shape $window me0.png flat.ppm -o x.spid
    one_line
    has "flat.ppm: no face"
    status 64 spid-shape $window me0.png camera:0 -o x.spid
    one_line
    status 64 spid-shape -o x.spid
    [ ! -e x.spid ]
}

@test "eight further pictures are too many" {
    status 64 spid-shape $window me0.png me1.png me1.png me1.png me1.png me1.png me1.png me1.png \
        me1.png -o x.spid
    has "7 further pictures already"
    [ ! -e x.spid ]
}

@test "teeth that the first picture hides have the colour that another shows" {
    need_numpy
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    spid-synth -q --size 512 --effects 0 -s 5 --frames 6 --fps 1 --turn 0 --without mesh -o say%d.png
    spid-motion -q $window say0.png -o wide.spid
    # say1: lips closed; say5: upper teeth, as they are and yellow
    ffmpeg -v error -i say5.png -f rawvideo -pix_fmt rgb24 -y a.raw
    "$PYTHON" - <<'PY'
import numpy as np
a = np.fromfile('a.raw', np.uint8).reshape(512, 512, 3)
teeth = a[320:337, 232:281]
teeth[teeth.min(2) > 90] = teeth[teeth.min(2) > 90] * [1, 0.98, 0.85]
a.tofile('yellow.raw')
PY
    ffmpeg -v error -f rawvideo -pix_fmt rgb24 -s 512x512 -i yellow.raw yellow.png
    for more in say5 yellow; do
        spid-shape -q $window say1.png $more.png -o $more.spid
        spid animate -q --absolute --star $more.spid wide.spid -o ${more}_%d.png
        ffmpeg -v error -i ${more}_0.png -f rawvideo -pix_fmt rgb24 $more.made
    done
    "$PYTHON" - <<'PY'
import numpy as np
a, b = (np.fromfile(f + '.made', np.uint8).reshape(512, 512, 3)[326:340, 226:278].astype(float)
        for f in ('say5', 'yellow'))
teeth = a.min(2) > 90
blue = [p[teeth][:, 2].mean() / p[teeth][:, 0].mean() for p in (a, b)]
print(teeth.sum(), blue)
assert teeth.sum() > 150 and blue[1] < 0.97 * blue[0]
PY
}
