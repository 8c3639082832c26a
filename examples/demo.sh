#!/usr/bin/env bash
# demo.sh OUT [FRAMES]: a photograph, driven by a synthetic clip, with the
# shipped model.  `make demo` runs it with the programs just built.
# The photograph: of one person at four camera distances the one from 45 cm, from
# the R package webmorphR.stim by Lisa DeBruine, CC0 1.0; saved anew.
#   OUT/avatar.mp4      the result (SpiD); star.mp4 without the refiner
#   OUT/sheet.png       source, driver, star, avatar, and the branches alone
#   OUT/report.html     all of it on one page, with times and metrics
#   OUT/avatar.html     the avatar to turn, play and pose in a browser
#   OUT/face.ply, head.glb   for other programs
set -euo pipefail
out=${1:?usage: demo.sh OUT [FRAMES]}
frames=${2:-60}
mkdir -p "$out"

echo "demo: a photograph, and a clip of somebody else"
cp "$(dirname "$0")/photo.jpg" "$out/source.jpg"
spid-synth --seed 31 --first 2 --people 1 --frames "$frames" --effects 0 \
    -o "$out/driver.mp4"

echo "demo: in one command"
spid animate "$out/source.jpg" "$out/driver.mp4" \
    -o "$out/avatar.mp4" --stats "$out/stats.tsv"
spid animate --star "$out/source.jpg" "$out/driver.mp4" \
    -o "$out/star.mp4"

echo "demo: the same stage by stage"
spid-shape "$out/source.jpg" -o "$out/me.spid"
spid-branches --bake "$out/me.spid" -o "$out/avatar.spid"
spid-motion --relative "$out/me.spid" "$out/driver.mp4" \
    -o "$out/motion.spid"
spid-flame -i "$out/avatar.spid" "$out/motion.spid" |
    spid-branches -i "$out/avatar.spid" -o "$out/frames.spid"
for branch in dynamic static mouth; do
    spid-splat --branch $branch "$out/frames.spid" -o "$out/$branch.mp4"
done
spid-export -q "$out/frames.spid" --ply "$out/face.ply" --frame 0
spid-export -q -i "$out/avatar.spid" "$out/motion.spid" \
    --glb-head "$out/head.glb"
spid-export -q -i "$out/avatar.spid" "$out/motion.spid" \
    --html "$out/avatar.html" || echo "demo: goes on without avatar.html"
spid-motion "$out/avatar.mp4" -o "$out/result.spid"

echo "demo: how good: two people never seen, first frame as source"
spid-synth --seed 2027 --people 2 --frames 6 --fps 2 \
    -o "$out/people.spid"
spid-eval --people "$out/people.spid" --format json >"$out/metrics.json"

spid-report "$out" --sheet "$out/sheet.png" -o "$out/report.html"
echo "demo: look at $out/sheet.png, $out/avatar.mp4, $out/avatar.html and" \
    "$out/report.html"
awk -F '\t' 'NR > 1 { printf "  %-12s %7.2f ms (median)\n", $1, $5 }' \
    "$out/stats.tsv"
