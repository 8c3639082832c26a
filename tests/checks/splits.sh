#!/usr/bin/env bash
# Who is learned from, chosen on and reported: examples/model/splits.tsv says it
# once for everybody, and examples/train-real.sh and reenact.sh keep to it.  The
# trainer is run with programs that only write down what they were asked.
set -uo pipefail
cd "${TOP:-$(dirname "$0")/../..}"
splits=examples/model/splits.tsv
fail=0
bad() { echo "FAILED $*"; fail=1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Three splits, four kinds; nobody in two, neither by name nor by prefix or
# range of seeds.
awk -F '\t' '
    /^#/ { next }
    NF != 3 || $1 !~ /^(training|validation|test)$/ || $2 !~ /^(photos|clip|scans|scenery)$/ {
        print "line " NR " is not split, kind, name"; next }
    $2 == "scans" {
        n = split($3, r, "-")
        if (n != 2 || r[1] + 0 > r[2] + 0) print $3 " is no range"
        for (k in lo) if (r[1] + 0 <= hi[k] && r[2] + 0 >= lo[k]) print $3 " and " k " overlap"
        lo[$3] = r[1] + 0; hi[$3] = r[2] + 0; next }
    {
        for (k in of) if (index(k, $3) == 1 || index($3, k) == 1) print $3 " and " k " are of one person"
        of[$3] = $1; seen[$1]++ }
    END { for (s in seen) n3++; if (n3 != 3) print "not three splits" }' "$splits" >"$work/form"
while read -r line; do bad "$splits: $line"; done <"$work/form"

# Everybody of the labels, where they are at hand.
people=../shared/assets/photos/people.csv
if [ -e "$people" ]; then
    for name in $(awk -F , 'NR > 1 { print "assets/photos/london/" $2 "_" }' "$people") \
        $(cd ../shared && ls assets/photos/cc0/* assets/clips/*.mpg real/*.mp4 assets/hdri/*.hdr); do
        n=$(awk -F '\t' -v name="$name" '!/^#/ && $2 != "scans" && index(name, $3) == 1' "$splits" | wc -l)
        [ "$n" -eq 1 ] || bad "$splits: $name has $n splits (expected 1)"
    done
fi

# The trainer.
mkdir "$work/bin"
cat >"$work/bin/spid-stub" <<'S'
#!/bin/sh
echo "$(basename "$0") $*" >>"$CALLS"
while [ $# -gt 0 ]; do
    case $1 in -o | --held | --join) mkdir -p "$(dirname "$2")"; : >"$2" ;; esac
    shift
done
S
chmod +x "$work/bin/spid-stub"
for p in spid-synth spid-fit spid-train spid-motion python3; do ln -s spid-stub "$work/bin/$p"; done
CALLS=$work/calls PATH=$work/bin:$PATH examples/train-real.sh assets "$work/out" >/dev/null 2>"$work/err" ||
    bad "examples/train-real.sh: $(head -n 1 "$work/err")"
[ "$(grep -c '^spid-fit' "$work/calls")" -ge 3 ] || bad "examples/train-real.sh fits nothing"
while read -r split kind name; do
    if [ "$kind" = scenery ]; then
        [ "$split" != training ] && want=0 || want=3   # matte twice, sure
        [ "$(grep -c -- "--scenery $name " "$work/calls")" -eq $want ] ||
            bad "examples/train-real.sh: $name is of $split (expected $want runs that learn from it)"
        continue
    fi
    [ "$kind" != scans ] && [ "$split" != training ] || continue
    while read -r call; do
        [[ "$call " == *" --except $name "* ]] ||
            { [ "$split" = validation ] && [[ "$call " == *" --hold $name "* ]]; } ||
            bad "examples/train-real.sh learns from $name ($split): ${call:0:60}"
    done < <(grep '^spid-fit' "$work/calls")
    ! grep -q "^spid-motion.*${name#assets/}" "$work/calls" ||
        bad "examples/train-real.sh: $name ($split) says how calm faces are"
done < <(grep -v '^#' "$splits")
# Seeds: of people to learn from, and of those held, which choose.
while read -r file seed; do
    case $file in held*) want=validation ;; *) want=training ;; esac
    awk -F '\t' -v s="$seed" -v want="$want" '$2 == "scans" && $1 == want {
        split($3, r, "-"); if (s + 0 >= r[1] + 0 && s + 0 <= r[2] + 0) ok = 1 } END { exit !ok }' "$splits" ||
        bad "examples/train-real.sh: $file is made of seed $seed, which is not of $want"
done < <(sed -n 's/^spid-synth.* --seed \([0-9]*\) .* -o .*\/\([^/ ]*\)$/\2 \1/p' "$work/calls")

# The figures: reenact.sh takes the clips of a split.
grep -q 'model/splits.tsv' examples/reenact.sh || bad "examples/reenact.sh does not read $splits"
mkdir "$work/shared"
SHARED=$work/shared PATH=$work/bin:$PATH CALLS=$work/more examples/reenact.sh --split validation -o "$work/r" >"$work/said" 2>&1
for name in $(awk -F '\t' '$1 == "validation" && $2 == "clip" { print $3 }' "$splits"); do
    grep -q "$work/shared/$name: left out" "$work/said" || bad "examples/reenact.sh leaves $name of validation"
done
for name in $(awk -F '\t' '$1 == "test" && $2 == "clip" { print $3 }' "$splits"); do
    ! grep -q "$name" "$work/said" || bad "examples/reenact.sh takes $name of test for validation"
done
exit $fail
