# examples/reenact.sh: self- and cross-reenactment from clips to a table.
load helper
load animate

prepare() { animate_files; }

@test "two clips: each drives itself and the other, the table says how" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$PWD/model
    spid-synth -q -n 1 --frames 3 -s 31 --first 2 --effects 0 --size 256 \
        --head "$HEAD" -o other.y4m
    head -c 300 drive.y4m >broken.y4m
    status 1 "$TOP/examples/reenact.sh" -s -n 2 -o run drive.y4m broken.y4m other.y4m
    has "broken.y4m: left out"
    has "SpiD*, self"
    has "SpiD*, cross"
    has "frame 0 unchanged, self"
    has "# cross: the source is the first frame of a clip, the driver the next"
    [ "$(wc -l <run/pairs.tsv)" -eq 8 ]
    [ "$(ls run/cross/other | wc -l)" -eq 2 ]
    spid-eval -q -f tsv --pairs run/pairs.tsv >table.tsv
    awk -F '\t' 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i }
        $1 ~ /^SpiD/ { if ($c["psnr"] < 1 || $c["akd"] <= 0 || $c["frames"] != 4) exit 1; n++ }
        END { exit n != 2 }' table.tsv
}

@test "a clip shorter than -n is taken whole" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$PWD/model
    status 0 "$TOP/examples/reenact.sh" -s -n 50 -o short drive.y4m
    [ "$(ls short/self/drive | wc -l)" -eq "$(ls short/truth/drive | wc -l)" ]
    [ "$(ls short/self/drive | wc -l)" -lt 50 ]
}

@test "--turned: a clip starts at its most turned frame and goes to the farther end" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    export SPID_MODEL=$PWD/model
    spid-synth -q -n 1 --frames 4 -s 31 --first 2 --effects 0 --size 256 --fps 20 \
        --turn 0,5,10,25 --head "$HEAD" -o turns.y4m
    status 0 env JUDGE=none "$TOP/examples/reenact.sh" -s -c -e 2 --turned -o turned turns.y4m
    has "SpiD* turned, self"
    has "0 of 1 sources refused"
    [ ! -d turned/cross/turns ]
    [ "$(ls turned/truth/turns | wc -l)" -eq 2 ]
    spid-dump --json --values --only MOTN turned/person/turns.whole.spid >whole.json
    ffmpeg -nostdin -v error -y -i turns.y4m -pix_fmt rgb24 turn%d.png
    # whichever the encoder calls most turned is the source
    most=$(python3 -c '
import json
f = [-a["data"][8] for l in open("whole.json") for a in json.loads(l)["arrays"] if a["name"] == "rot"]
print(f.index(min(f)) + 1)')
    cmp <(ffmpeg -v error -i turned/person/turns.png -f rawvideo -pix_fmt rgb24 -) \
        <(ffmpeg -v error -i turn$most.png -f rawvideo -pix_fmt rgb24 -)
}

@test "--people: what stands before a person counts for nobody" {
    need_numpy
    spid-synth -q -n 1 --frames 3 -s 4 --fps 1 --effects 0 --size 128 \
        --head "$HEAD" --without mesh -o people.spid
    spid-dump -q --npy plain -o /dev/null people.spid
    cat >hide.py <<'P'
import shutil, sys
import numpy as np
for name, label, paint in (("hidden", 15, 0), ("painted", 15, 200), ("seen", 1, 200)):
    shutil.copytree("plain", name)
    for array, value in (("label", label), ("rgb", paint)):
        a = np.load(f"plain/IMAG.{array}.npy").copy()
        a[1:, 75:100, 45:75] = value      # not of the source, frame 0
        np.save(f"{name}/IMAG.{array}.npy", a)
P
    "$PYTHON" hide.py
    for name in hidden painted seen; do
        spid-pack -q -o $name.spid $name
        spid-eval -q -f tsv --people $name.spid --known motion --count 1 \
            --no-cross --no-ablations -m model >$name.tsv
    done
    grep -q '^SpiD' hidden.tsv
    cmp hidden.tsv painted.tsv
    ! cmp -s hidden.tsv seen.tsv
}
