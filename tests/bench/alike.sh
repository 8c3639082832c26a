#!/usr/bin/env bash
# alike.sh [-n PEOPLE] DIR: what tells two pictures of one person from two
# people's, by which spid-shape leaves strangers out (lib/track/views.h).
#
# Every person of a split (SPLIT, validation by default; examples/model/splits.tsv)
# with two photographs or more, and PEOPLE of its people of scans (default 16),
# turned to 45, -45, 0 and 20 degrees, in DIR; each person's first picture beside
# the others and beside the last picture of the next four people of its kind.
# DIR/alike.tsv: same or other, kind, likeness.  Printed: for each threshold the
# share of one person's pictures that are called a stranger's, and of strangers
# that are found, of photographs and of scans.  Needs ../shared; else status 77.
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
shared=${SHARED:-$top/../shared}
PATH=$top/${BUILD:-build}/bin:$PATH
people=16
while getopts n: option; do
    case $option in
    n) people=$OPTARG ;;
    *) exit 64 ;;
    esac
done
shift $((OPTIND - 1))
[ $# = 1 ] || { sed -n '2s/^# *//p' "$0" >&2; exit 64; }
[ -e "$shared/assets/photos" ] || { echo "alike.sh: skipped: no assets in $shared" >&2; exit 77; }
out=$1
splits() {
    awk -F '\t' -v s="${SPLIT:-validation}" -v k="$1" '$1 == s && $2 == k { print $3 }' \
        "$top/examples/model/splits.tsv"
}
mkdir -p "$out"
: >"$out/alike.tsv"

# compare KIND: lines of standard input are people, their pictures on each.
compare() {
    local person i j
    mapfile -t person
    for i in "${!person[@]}"; do
        local own other=()
        read -ra own <<<"${person[i]}"
        for j in 1 2 3 4; do
            other+=("${person[(i + j) % ${#person[@]}]##* }")
        done
        spid-shape "${own[@]}" "${other[@]}" -o /dev/null 2>&1 |
            sed -n 's/.*likeness \(-\?[0-9.]*\).*/\1/p' |
            awk -v k="$1" -v n=$((${#own[@]} - 1)) \
                '{ print (NR <= n ? "same" : "other") "\t" k "\t" $1 }' >>"$out/alike.tsv"
    done
}

splits photos | while read -r name; do
    files=("$shared/$name"*.jpg)
    [ ${#files[@]} -lt 2 ] || echo "${files[@]}"
done | compare photos
for ((k = 0; k < people; k++)); do
    [ -e "$out/$k-3.png" ] ||
        spid-synth -q --assets "$shared/assets" --seed "$(splits scans | sed 's/-.*//;q')" \
            --size 512 --first "$k" --frames 4 --fps 3 --effects 0.4 --without mesh \
            --turn 45,-45,0,20 -o "$out/$k-%d.png"
    echo "$out/$k-"{0,1,2,3}.png
done | compare scans
awk -F '\t' '
    { n[$1 $2]++; for (t = -20; t <= 4; t += 2) below[$1 $2, t] += $3 < t / 10 }
    END {
        print "threshold  photographs: false, found    scans: false, found"
        for (t = -20; t <= 4; t += 2) {
            printf "%9.1f", t / 10
            for (k = 0; k < 2; k++) {
                kind = k ? "scans" : "photos"
                printf "%14.3f %9.3f", below["same" kind, t] / n["same" kind],
                    below["other" kind, t] / n["other" kind]
            }
            print ""
        }
        for (k in n) print n[k], "pairs of", k
    }' "$out/alike.tsv"
