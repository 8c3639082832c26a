# spid-fit: labelled photographs as training data, and labels that are none.
load helper

setup_file() {
    export ASSETS=$TOP/../shared/assets
}

# fit OPTION ...: the two people of the CC0 photographs, small.
fit() {
    spid-fit -q --assets "$ASSETS" --except assets/photos/london --size 64 \
        --rounds 2 --head "$TOP/examples/model/head.safetensors" \
        "$@" "$ASSETS/labels/photos.safetensors"
}

has_labels() {
    [ -e "$ASSETS/labels/photos.safetensors" ] && [ -e "$ASSETS/ict" ] &&
        [ -e "$ASSETS/photos/cc0" ] || skip "no labels in the shared assets (SPID_ASSETS)"
}

@test "labelled photographs become people, the same for any thread count" {
    has_labels
    fit -j 1 -o one.spid
    fit -j 3 -o three.spid
    cmp one.spid three.spid
    spid-dump --check one.spid
    [ "$(spid-dump --json --only SHAP one.spid | wc -l)" -eq 2 ]
    [ "$(spid-dump --json --only IMAG one.spid | wc -l)" -eq 8 ]
}

@test "before a plain wall nobody of these stands" {
    has_labels
    fit --plain -o plain.spid
    spid-dump --check plain.spid
    [ "$(spid-dump --json plain.spid | grep -c CONF)" -eq 1 ]
    [ -z "$(spid-dump --json --only SHAP,MOTN,IMAG plain.spid)" ]
}

@test "frames that --same joins are one person" {
    has_labels
    fit --same lisa1,15cm -o one.spid
    [ "$(spid-dump --json --only SHAP one.spid | wc -l)" -eq 1 ]
}

@test "who is held goes to a stream of their own, by the same fit" {
    has_labels
    shapes() { # FILE...: without the frames' numbers
        for file; do
            spid-dump --json --values --only SHAP "$file" |
                sed 's/.*"arrays"//'
        done
    }
    fit -o all.spid
    fit --hold assets/photos/cc0/lisa --hold nobody --held held.spid \
        -o rest.spid
    shapes rest.spid held.spid >parts
    shapes all.spid | diff - parts
    [ "$(spid-dump --json --only IMAG held.spid | wc -l)" -eq 4 ]
    [ "$(spid-dump --json --only IMAG rest.spid | wc -l)" -eq 4 ]
    status 64 fit --held held.spid -o x.spid
    has 'hold and --held'
    status 73 fit --hold assets --held none/held.spid -o x.spid
    [ ! -e x.spid ]
}

@test "several beginnings of names may be left out" {
    has_labels
    fit --except assets/photos/cc0/lisa1 --except assets/photos/cc0/15 \
        -o some.spid
    [ "$(spid-dump --json --only IMAG some.spid | wc -l)" -eq 6 ]
}

@test "of a clip each n-th frame" {
    has_labels
    spid-fit -q --assets "$ASSETS" --except assets/clips/b \
        --except assets/clips/i --except assets/clips/l --except real/ \
        --size 64 --rounds 1 --head "$TOP/examples/model/head.safetensors" \
        --every 10 -o tenth.spid "$ASSETS/labels/clips.safetensors"
    spid-dump --check tenth.spid
    [ "$(spid-dump --json --only SHAP tenth.spid | wc -l)" -eq 1 ]
    [ "$(spid-dump --json --only IMAG tenth.spid | wc -l)" -eq 8 ]
}

@test "masks may be the matte network's" {
    has_labels
    need_numpy
    big() {
        fit --except assets/photos/cc0/lisa --size 256 "$@" \
            -m "$TOP/examples/model/model.safetensors"
    }
    big -j 1 --matte -o net.spid
    big -j 3 --matte -o three.spid
    cmp net.spid three.spid
    big -o cut.spid
    spid-dump -q --npy net net.spid
    spid-dump -q --npy cut cut.spid
    "$PYTHON" -c '
import numpy as np
net, cut = (np.load(f"{k}/IMAG.mask.npy") / 255 for k in ("net", "cut"))
# whom the network sees is within what the outline of the head leads to, which
# takes the door behind these people for their hair; all of a picture is not
within = np.minimum(net, cut).sum() / net.sum()
print(within, net.mean((1, 2)), cut.mean((1, 2)))
assert within > 0.85 and (net.mean((1, 2)) > 0.25).all() and cut.mean() < 0.5
assert (net[:, 128, 128] > 0.9).all() and (cut[:, 128, 128] > 0.9).all()
assert (net[:, :20] < 0.5).mean() > 0.9'
}

@test "photographs act as avatars, with their truth" {
    has_labels
    spid-synth -q -n 2 --frames 3 --size 64 --without mesh -o moves.spid \
        --head "$TOP/examples/model/head.safetensors"
    acts() {
        fit --size 128 --motions moves.spid --acts 2 "$@" \
            -m "$TOP/examples/model/model.safetensors"
    }
    acts -j 1 -o one.spid
    acts -j 3 -o three.spid
    cmp one.spid three.spid
    spid-dump --check one.spid
    [ "$(spid-dump --json --only SHAP one.spid | wc -l)" -eq 2 ]
    [ "$(spid-dump --json --only IMAG one.spid | wc -l)" -eq 24 ]
    [ "$(spid-dump --json --only MOTN one.spid | grep -c lmk)" -eq 24 ]
    status 65 acts --motions "$TOP/examples/model/head.safetensors" -o x.spid
    has head.safetensors
    [ ! -e x.spid ]
}

@test "faces that act are uneven where who acts is even" {
    has_labels
    need_numpy
    spid-synth -q -n 1 --frames 1 --size 64 --without mesh -o one.spid \
        --head "$TOP/examples/model/head.safetensors"
    spid-dump --json --values --only CONF,MOTN one.spid | "$PYTHON" -c '
import json, sys
for line in sys.stdin:
    record = json.loads(line)
    for array in record["arrays"]:
        if array["name"] == "exp":
            array["data"] = [0] * len(array["data"])
    print(json.dumps(record))' >even.json
    spid-pack even.json -o even.spid
    fit --size 64 --motions even.spid --acts 8 \
        -m "$TOP/examples/model/model.safetensors" -o acts.spid
    spid-dump -q --npy acts acts.spid
    "$PYTHON" -c '
import numpy as np
exp = np.load("acts/MOTN.exp.npy")
aside = np.abs(exp[:, 34] - exp[:, 40])     # mouthLeft, mouthRight
assert 0.1 < np.mean(aside > 0.1) < 0.6, aside'
}

@test "a picture that is missing is named, and nothing is left" {
    has_labels
    run fit --base . -o x.spid
    [ "$status" -eq 66 ]
    [[ $output == *15cm.jpg* ]]
    [ ! -e x.spid ]
}

@test "a full disk is noticed, and leaves nothing" {
    has_labels
    run bash -c "$(declare -f fit); trap '' XFSZ; ulimit -f 0; fit -o full.spid"
    [ "$status" -eq 74 ]
    has full.spid
    [ -z "$(ls full.spid* 2>/dev/null)" ]
}

@test "labels and scans that are missing or something else are named" {
    status 66 spid-fit --assets . nothing.safetensors -o x.spid
    has nothing.safetensors
    status 65 spid-fit --assets . -o x.spid \
        "$TOP/examples/model/head.safetensors"
    has landmarks
    status 64 spid-fit nothing.safetensors
    has --assets
    status 64 spid-fit --assets . --same one nothing.safetensors
    has A,B
}

@test "a head that is not of the scans is refused" {
    has_labels
    other_head other.safetensors
    status 78 spid-fit --assets "$ASSETS" -o x.spid \
        --head other.safetensors "$ASSETS/labels/photos.safetensors"
    has "registered to the scans"
}
