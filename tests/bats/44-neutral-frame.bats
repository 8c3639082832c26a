#!/usr/bin/env bats
# Relative motion and the driver's frame at rest.
load helper
load animate

prepare() {
    need_numpy
    animate_files
}

# jaws FILE: the jaw of every motion, a line each; those of an identity too.
jaws() {
    spid-dump --npy . --only MOTN "$1"
    "$PYTHON" -c "import numpy as np
for row in np.load('MOTN.jaw.npy').reshape(-1, 3): print(*np.round(row, 4))"
}

# line N: that line of standard input.
line() { sed -n "$1p"; }

@test "in its neutral frame the driver leaves the source as it was" {
    own=$(jaws me.spid)
    for n in 0 2; do
        spid-motion -q -m model --relative me.spid --neutral $n drive.y4m -o $n.spid
        [ "$(jaws $n.spid | line $((n + 1)))" = "$own" ]
    done
    spid-motion -q -m model --relative me.spid drive.y4m -o first.spid
    cmp first.spid 0.spid
    status 1 cmp -s 0.spid 2.spid
    spid-motion -q -m model --relative me.spid --neutral first drive.y4m -o a.spid
    cmp first.spid a.spid
}

@test "auto is one of the clip's frames" {
    spid-motion -q -m model --relative me.spid --neutral auto drive.y4m -o auto.spid
    same=0
    for n in 0 1 2 3; do
        spid-motion -q -m model --relative me.spid --neutral $n drive.y4m -o n.spid
        ! cmp -s auto.spid n.spid || same=$((same + 1))
    done
    [ $same = 1 ]
}

@test "one process and the pipe agree on the neutral frame" {
    set -o pipefail
    spid-animate -q -m model -s --neutral 2 avatar.spid drive.y4m -o one.y4m
    spid-motion -q -m model --relative avatar.spid --neutral 2 drive.y4m |
        spid-flame -m model -i avatar.spid | spid-branches -i avatar.spid |
        spid-splat -q --size 128 -o pipe.y4m
    cmp one.y4m pipe.y4m
}

@test "animate is relative unless told otherwise" {
    spid-animate -q -m model -s avatar.spid drive.y4m -o a.y4m
    spid-animate -q -m model -s --neutral first avatar.spid drive.y4m -o b.y4m
    spid-animate -q -m model -s --absolute avatar.spid drive.y4m -o c.y4m
    cmp a.y4m b.y4m
    status 1 cmp -s a.y4m c.y4m
    for other in "--neutral 1" "--into-source"; do
        status 64 spid-animate -q -m model -s --absolute $other avatar.spid drive.y4m -o x.y4m
        one_line
    done
}

@test "a neutral frame that cannot be is refused in one line" {
    status 64 spid-motion -q -m model --relative me.spid --neutral soon drive.y4m -o x.spid
    one_line
    has 'not a frame (expected first, auto or a number from 0)'
    status 64 spid-motion -q -m model --neutral 2 drive.y4m -o x.spid
    one_line
    status 64 spid-motion -q -m model --relative me.spid --neutral auto - -o x.spid <drive.y4m
    one_line
    has '--neutral reads a clip twice'
    status 65 spid-motion -q -m model --relative me.spid --neutral 99 drive.y4m -o x.spid
    one_line
    has 'no frame 99 with a face'
    status 65 spid-animate -q -m model -s --neutral 99 avatar.spid drive.y4m -o x.y4m
    one_line
    [ ! -e x.spid ] && [ ! -e x.y4m ]
}

@test "a grin in the photograph is not the person's: a calm driver takes it away" {
    photos=${SPID_ASSETS:-$TOP/../shared/assets}/photos/london
    [ -e "$photos" ] || skip "no photographs in $photos (SPID_ASSETS)"
    [ -e "$TOP/examples/model/model.safetensors" ] || skip "no model shipped (make model)"
    export SPID_MODEL=$TOP/examples/model
    smiles() { # FILE: both mouthSmiles of its first motion, their mean
        spid-dump -q --npy s --only MOTN "$1"
        "$PYTHON" -c 'import numpy as np
print(round(float(np.load("s/MOTN.exp.npy").reshape(-1, 100)[0, 45:47].mean()), 3))'
        rm -r s
    }
    spid-shape -q "$photos/012_smiling.jpg" -o grin.spid
    spid-shape -q "$photos/100_neutral.jpg" -o calm.spid
    # driven by somebody calm, and by somebody who grins from the first frame
    spid-motion -q --relative grin.spid "$photos/100_neutral.jpg" -o gc.spid
    spid-motion -q --relative grin.spid "$photos/100_smiling.jpg" -o gg.spid
    spid-motion -q --relative calm.spid "$photos/012_smiling.jpg" -o cg.spid
    spid-motion -q --relative calm.spid "$photos/012_neutral.jpg" -o cc.spid
    for s in grin calm gc gg cg cc; do eval "$s=$(smiles $s.spid)"; echo "$s ${!s}"; done
    "$PYTHON" -c "
assert $grin > 0.3 and abs($calm) < 0.15
assert $gc < 0.25 and $gg > 0.3        # away, and back
assert $cg > 0.3 and abs($cc - $calm) < 0.1"
}

@test "a driver who begins within a word rests with the mouth shut" {
    assets=${SPID_ASSETS:-$TOP/../shared/assets}
    [ -e "$assets/clips" ] || skip "no clips in $assets (SPID_ASSETS)"
    [ -e "$TOP/examples/model/model.safetensors" ] || skip "no model shipped (make model)"
    export SPID_MODEL=$TOP/examples/model
    ffmpeg -v error -i "$assets/clips/lbax4n.mpg" -frames:v 1 word.png
    spid-shape -q "$assets/photos/london/100_neutral.jpg" -o calm.spid
    gap() { # MOTION: mm between the lips of its first frame, on one head
        spid-flame -q -i calm.spid "$1" | spid-dump -q --npy g --only MESH -
        "$PYTHON" -c 'import numpy as np; print(np.load("g/MESH.gap.npy").flat[0] * 1000 / 5)'
        rm -r g
    }
    spid-motion -q word.png -o word.spid
    spid-motion -q --relative calm.spid word.png -o driven.spid
    for s in calm word driven; do eval "$s=$(gap $s.spid)"; echo "$s ${!s}"; done
    # no less opened than the driver's are apart, and not by more than calm lips err
    "$PYTHON" -c "assert $calm < 1 and $word > 6 and abs($driven - $word) < 1.5"
}
