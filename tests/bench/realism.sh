#!/usr/bin/env bash
# What another landmarker makes of rendered people, beside their truth: faces
# found, its points' distance, correlation of its blendshapes.
#
#   realism.sh [PEOPLE [SEED [FOLDER]]]
#
# Needs ../shared (assets and tools/label, whose packages its setup.sh puts into
# the home folder), node, chromium and python3 with numpy; ends with status 77
# where something is missing.  FOLDER keeps streams, pictures and labels.
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
people=${1:-200} seed=${2:-9001} work=${3:-}
shared=${SHARED:-$top/../shared} size=${SIZE:-512}
label=$shared/tools/label/label.mjs assets=$shared/assets
PATH=$top/${BUILD:-build}/bin:$PATH

skip() {
    echo "realism.sh: skipped: $*" >&2
    exit 77
}
[ -e "$label" ] && [ -e "$assets/ict" ] || skip "no assets and tools in $shared"
[ -d "${LABEL_NODE:-$HOME/.cache/label_node}" ] ||
    skip "no packages of the labeller (run $(dirname "$label")/setup.sh)"
for python in python3 /usr/bin/python3 ''; do
    [ -n "$python" ] || skip "no python3 with numpy"
    "$python" -c 'import numpy' 2>/dev/null && break
done
[ -n "$work" ] || { work=$(mktemp -d); trap 'rm -rf "$work"' EXIT; }

# measure TITLE NAME OPTION...: people, their pictures, labels and figures.
measure() {
    local title=$1 at=$work/$2
    shift 2
    mkdir -p "$at/png"
    spid-synth -q -n "$people" -s "$seed" --size "$size" --without mesh "$@" \
        -o "$at/people.spid"
    spid-dump -q --npy "$at/truth" -o /dev/null "$at/people.spid"
    "$python" "$top/tests/bench/realism.py" --pictures "$at/truth" "$at/png"
    "$label" "$at/labels.safetensors" \
        --model "$assets/mediapipe/face_landmarker.task" \
        --base "$at/png" "$at"/png/*.ppm 2>"$at/label.log"
    "$python" "$top/tests/bench/realism.py" "$title" "$at/truth" \
        "$at/labels.safetensors" "$assets/labels/mediapipe_to_ict.json"
}
measure "people of scans" scans --assets "$assets"
measure "procedural people" drawn
