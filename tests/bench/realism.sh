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

mkdir -p "$work/png"
spid-synth -q -n "$people" -s "$seed" --size "$size" --without mesh --assets "$assets" \
    -o "$work/people.spid"
spid-dump -q --npy "$work/truth" -o /dev/null "$work/people.spid"
"$python" "$top/tests/bench/realism.py" --pictures "$work/truth" "$work/png"
"$label" "$work/labels.safetensors" \
    --model "$assets/mediapipe/face_landmarker.task" \
    --base "$work/png" "$work"/png/*.ppm 2>"$work/label.log"
"$python" "$top/tests/bench/realism.py" "people of scans" "$work/truth" \
    "$work/labels.safetensors" "$assets/labels/mediapipe_to_ict.json"
