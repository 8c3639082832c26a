#!/bin/sh
# eval-model.sh DIR SEED PEOPLE FRAMES: the model on people it has never seen;
# DIR/metrics.json (FORMAT=tsv: metrics.tsv) and DIR/sheet.png.  `make eval-model`.
# The people are spid-synth's, of the scans in ASSETS or plain figures, with all
# camera effects, one frame a second of their time; EFFECTS=0 leaves noise,
# blur, JPEG and occluders out.
set -eu
dir=$1 seed=$2 people=$3 frames=$4
mkdir -p "$dir"
synth() {
    spid-synth --people "$people" --frames "$frames" --seed "$((500000 + seed))" \
        --fps "${FPS:-1}" --effects "${EFFECTS:-1}" --size 512 --without mesh \
        ${ASSETS:+--assets "$ASSETS"} -q -o "$dir/people.spid"
}
synth
spid-eval --people "$dir/people.spid" --count "$people" --frames "$frames" \
    ${MODEL:+-m "$MODEL"} --format "${FORMAT:-json}" -o "$dir/metrics.${FORMAT:-json}" \
    --sheet "$dir/sheet.png" ${LPIPS:+--lpips "$LPIPS"}
rm -f "$dir/people.spid"
cat "$dir/metrics.${FORMAT:-json}"
