#!/usr/bin/env bash
# Photographs taken from the side, by people of scans whose every side is known.
#
#   turned.sh figures [-n PEOPLE] [-t YAW,...] DIR [OPTION OF reenact.sh...]
#   turned.sh sheet DIR
#
# figures: clips that turn from 45 degrees to one side to 45 to the other, each
#   driven by itself from its first frame by examples/reenact.sh; its table, and
#   the decibels of the half of the face that the first frame hides.  -t: the
#   head's turns instead, the photograph's first.
# sheet: DIR/sheet.png.  Eight people; for each a block whose first row is the
#   person from the front and a driver in five poses, then a row for each source
#   (-45, -25, 0, 25, 45 degrees): it, and it in these poses.
#
# SPLIT (validation by default, test to report) says whose seeds are taken: the
# first of that split's range in examples/model/splits.tsv.  Needs ../shared
# (assets), ffmpeg and python3 with numpy; ends with status 77 without them.
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
shared=${SHARED:-$top/../shared}
PATH=$top/${BUILD:-build}/bin:$PATH
people=6 turns=

skip() {
    echo "turned.sh: skipped: $*" >&2
    exit 77
}
[ $# -ge 2 ] || { sed -n '4,5s/^# *//p' "$0" >&2; exit 64; }
what=$1
shift
while getopts n:t: option; do
    case $option in
    n) people=$OPTARG ;;
    t) turns=$OPTARG ;;
    *) exit 64 ;;
    esac
done
shift $((OPTIND - 1))
out=$1
shift
[ -e "$shared/assets/ict" ] || skip "no assets in $shared"
command -v ffmpeg >/dev/null || skip "no ffmpeg"
for python in python3 /usr/bin/python3 ''; do
    [ -n "$python" ] || skip "no python3 with numpy"
    "$python" -c 'import numpy' 2>/dev/null && break
done
seed=$(awk -F '\t' -v s="${SPLIT:-validation}" '$1 == s && $2 == "scans" {
    sub(/-.*/, "", $3); print $3; exit }' "$top/examples/model/splits.tsv")
[ -n "$seed" ] || { echo "turned.sh: no split '${SPLIT:-}'" >&2; exit 64; }
mkdir -p "$out"

synth() {
    spid-synth -q --assets "$shared/assets" --seed "$seed" --size 512 "$@"
}

figures() {
    local side k turn clips=()
    for ((k = 0; k < people; k++)); do
        side=$((k % 2 ? -1 : 1))
        turn=$(seq -s , $((45 * side)) "$((-7 * side)).5" $((-45 * side)))
        turn=${turns:-$turn}
        synth --first "$k" --frames "$(tr , '\n' <<<"$turn" | wc -l)" \
            --fps 8 --effects 0.4 --turn "$turn" \
            -o "$out/$k.spid"
        spid-dump -q --npy "$out/npy$k" -o /dev/null "$out/$k.spid"
        rm "$out/$k.spid"
        "$python" -c 'import sys, numpy
sys.stdout.buffer.write(numpy.load(sys.argv[1]).tobytes())' \
            "$out/npy$k/IMAG.rgb.npy" |
            ffmpeg -v error -y -f rawvideo -pix_fmt rgb24 -s 512x512 -r 8 \
                -i - -c:v ffv1 "$out/scan$k.mkv"
        clips+=("$out/scan$k.mkv")
    done
    "$top/examples/reenact.sh" -c -o "$out/run" "$@" "${clips[@]}" || true
    "$python" "$top/tests/bench/turned.py" "$out" "$people"
}

# tile GRID OUT PICTURE...
tile() {
    local grid=$1 to=$2
    shift 2
    cat "$@" | ffmpeg -v error -y -f image2pipe -c:v png -i - \
        -vf "scale=128:128:flags=area,tile=$grid" -frames:v 1 "$to"
}

sheet() {
    local k i blocks=() yaws=(-45 -25 0 25 45)
    synth -n 8 --frames 5 --fps 1000 --effects 0.4 --without mesh \
        --turn "$(IFS=,; echo "${yaws[*]}")" -o "$out/%05d.png"
    synth --first 20 --frames 5 --fps 1 --effects 0 --without mesh \
        --turn 0,35,-35,15:18,-15:-18 -o "$out/driver%05d.png"
    spid-motion -q --no-align "$out"/driver0000?.png -o "$out/driver.spid"
    for k in {0..7}; do
        local row=("$out/$(printf %05d $((5 * k + 2))).png" "$out"/driver0000?.png)
        for i in {0..4}; do
            local source
            source=$out/$(printf %05d $((5 * k + i))).png
            rm -f "$out/result"?????.png
            spid animate -q --absolute "$source" "$out/driver.spid" \
                -o "$out/result%05d.png" || {
                echo "turned.sh: person $k at ${yaws[i]} degrees: refused" >&2
                for j in {0..4}; do cp "$source" "$out/result0000$j.png"; done
            }
            tile 6x1 "$out/row$i.png" "$source" "$out/result"?????.png
        done
        tile 6x1 "$out/head.png" "${row[@]}"
        ffmpeg -v error -y -i "$out/head.png" -i "$out/row0.png" \
            -i "$out/row1.png" -i "$out/row2.png" -i "$out/row3.png" \
            -i "$out/row4.png" -filter_complex vstack=6 "$out/block$k.png"
        blocks+=(-i "$out/block$k.png")
    done
    ffmpeg -v error -y "${blocks[@]}" -filter_complex \
        '[0][1][2][3]hstack=4[a];[4][5][6][7]hstack=4[b];[a][b]vstack' \
        "$out/sheet.png"
    rm -f "$out"/block?.png "$out"/row?.png "$out"/head.png \
        "$out"/result?????.png
}

case $what in
figures) figures "$@" ;;
sheet) sheet ;;
*) sed -n '4,5s/^# *//p' "$0" >&2; exit 64 ;;
esac
