#!/usr/bin/env bash
# paper.sh OUT [CLIP ...]: the paper's tables, its latencies and what speed costs,
# from what is at hand, by the programs on the PATH.
#   OUT/table1.tsv    cross-reenactment of the clips, SpiD* and SpiD (reenact.sh)
#   OUT/table2.tsv    self-reenactment
#   OUT/table3.tsv    SpiD* without each of its parts (left out, not trained anew),
#                     by the clips, and on people of spid-synth (eval-model.sh);
#                     with RECORDS, trained on without it, too, a row for each seed
#   OUT/latency.txt   where the time of a frame goes, beside the paper's
#   OUT/tradeoff.svg  error over time of every knob; its rows are in OUT/bench.txt
#   OUT/paper.txt     all of it to read, and what was not run, and what it needs
# The last columns of a table are commit, data and machine.  Clips: by default
# those of test in model/splits.tsv, below $SHARED (the folder shared beside the
# checkout).  What fails is named, and makes the exit 1.
#   METHODS         other models, "GAGAvatar=FILE LAM=FILE ..." (spid-import --as
#                   gagavatar, lam), with head.safetensors beside each
#   LPIPS, ARCFACE, MUSIQ, TOPIQ   weights for spid-eval, as spid-import makes them
#   ASSETS          of spid-synth, for people of scans (without, plain figures)
#   RECORDS         training records (train-real.sh makes pairs.spid, people-1.spid):
#                   each part's own model, STEPS on from this one, on these, for
#                   each of SEEDS ("1 2"), by config/small-parts.json; HELD: others,
#                   of people kept out, beside the clips.  A run that was stopped
#                   goes on where it was
#   CLIP_FRAMES, PEOPLE, FRAMES, BENCH   how much: frames of a clip (all), people
#                   and frames of each for table 3 (40, 25), seconds a stage (20)
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
export SHARED=${SHARED:-$here/../../shared} JUDGE=none BACKGROUND=source
[ $# -ge 1 ] || { sed -n '2,25s/^# \{0,1\}//p' "$0" >&2; exit 64; }
out=$1 bad=0 tables=()
shift
mkdir -p "$out/run" || exit 73
rm -f "$out/table3.tsv"
: >"$out/missing"
export EVAL="-f tsv ${LPIPS:+--lpips $LPIPS} ${ARCFACE:+--arcface $ARCFACE} ${MUSIQ:+--musiq $MUSIQ} ${TOPIQ:+--topiq $TOPIQ}"

commit=$(git -C "$here" describe --always --dirty 2>/dev/null || spid --version)
machine=$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)
machine="${machine:-$(uname -m)}, $(nproc) threads"

# missing WHAT NEEDS: a line of what was not run.
missing() {
    echo "$1: not run: needs $2" | tee -a "$out/missing" >&2
}

# failed WHAT LOG: how it ended; the rest is made.
failed() {
    echo "paper.sh: $1: failed, see $2: $(tail -n 1 "$2")" >&2
    bad=1
}

# stamped DATA: a table and whence each row is.
stamped() {
    awk -v c="$commit" -v d="$1" -v m="$machine" -v OFS='\t' \
        'NR == 1 { print $0, "commit", "data", "machine"; next } { print $0, c, d, m }'
}

# reenacted METHOD [-s]: its figures, in OUT/run.
reenacted() {
    local name=$1 dir=$out/run/$1${2:-}
    shift
    METHOD=$name "$here/reenact.sh" "$@" ${CLIP_FRAMES:+-n "$CLIP_FRAMES"} -o "$dir" \
        "${clips[@]}" >"$dir.tsv" 2>"$dir.log" || failed "$name" "$dir.log"
    sed -n 's/^# \(.*: not run: .*\)/\1/p' "$dir.tsv" >>"$out/missing"
    tables+=("$dir.tsv")
}

# rows PROTOCOL COLUMN...: that protocol's rows of all methods, the paper's columns
# in its order and how many frames; "-" is what was not measured.
rows() {
    local protocol=$1
    shift
    awk -F '\t' -v protocol="$protocol" -v columns="$*" '
        BEGIN { n = split(columns " frames", column, " "); line = "method"
                for (i = 1; i <= n; i++) line = line "\t" column[i]
                print line }
        FNR == 1 { delete at; for (i = 1; i <= NF; i++) at[$i] = i; next }
        !sub(", " protocol "$", "", $1) || seen[$1]++ { next }
        { line = $1
          for (i = 1; i <= n; i++)
              line = line "\t" (column[i] in at ? $at[column[i]] : "-")
          print line }' "${tables[@]}"
}

# ---- tables 1 and 2, and 3 by clips ------------------------------------------

data=clips clips=("$@")
for clip; do
    data+=" $(basename "$clip")"
done
if [ $# = 0 ]; then
    data="clips of test"
    while read -r name; do
        if [ -e "$SHARED/$name" ]; then
            clips+=("$SHARED/$name")
        else
            missing "$name" "that clip in $SHARED"
        fi
    done < <(awk -F '\t' '$1 == "test" && $2 == "clip" { print $3 }' "$here/model/splits.tsv")
fi
if [ ${#clips[@]} = 0 ]; then
    missing "tables 1 and 2" "clips (paper.sh OUT CLIP ...)"
else
    for method in ${METHODS:-}; do
        SPID_MODEL=${method#*=} reenacted "${method%%=*}"
    done
    reenacted SpiD -s
    reenacted SpiD
    data="$data, ${CLIP_FRAMES:-all} frames"
    rows cross akd aed apd lpips psnr ssim msssim l1 musiq topiq | stamped "$data" >"$out/table1.tsv"
    rows self psnr ssim msssim lpips l1 musiq arcface akd aed apd | stamped "$data" >"$out/table2.tsv"
    tables=()
    WITHOUT='dynamic static interp deform mouth neck' reenacted full -s -c
    rows self psnr ssim lpips arcface aed akd | sed 's,^full\*,full,' | grep -v '^frame 0' |
        stamped "$data" >"$out/table3.tsv"
fi
for method in GAGAvatar LAM; do
    [[ " ${METHODS:-}" == *" $method="* ]] ||
        missing $method "its checkpoint as a model (METHODS, spid-import --as ${method,,})"
done
missing "GPAvatar, Portrait4D-v2, LivePortrait, VOODOO-XP, CVTHead" \
    "their own programs, whose videos spid-eval --pairs compares"

# ---- table 3 ----------------------------------------------------------------

people=${PEOPLE:-40} frames=${FRAMES:-25}
if FORMAT=tsv "$here/eval-model.sh" "$out/run" 77 "$people" "$frames" >"$out/run/people.log" 2>&1; then
    # "w/o nothing" is SpiD* as it is, on the same frames as the parts
    sed 's,^w/o nothing,full,' "$out/run/metrics.tsv" | awk -F '\t' '
        NR == 1 || /^full|^w\/o/ { print $1 ", parts" substr($0, length($1) + 1) }' >"$out/run/parts.tsv"
    tables=("$out/run/parts.tsv")
    rows parts psnr ssim lpips arcface aed akd |
        stamped "$people people, ${ASSETS:+of scans }$frames frames, seed 77" |
        if [ -e "$out/table3.tsv" ]; then sed 1d; else cat; fi >>"$out/table3.tsv"
else
    failed "table 3" "$out/run/people.log"
fi

# ---- table 3, trained on without ----------------------------------------------

# trained PART SEED: OUT/run/without-PART-SEED/model.safetensors, and its rows.
trained() {
    local name=without-$1-$2 row="w/o $1, trained on, seed $2"
    local dir=$out/run/$name
    mkdir -p "$dir/run" && cp "${model%/*}/head.safetensors" "$dir" || return
    sed "s/\"seed\": 1/\"seed\": $2/; s/\"nothing\"/\"$1\"/; s:\.\./shared:$SHARED:" \
        "$here/config/small-parts.json" >"$dir/config.json"
    # shellcheck disable=SC2086
    spid-train -q -c "$dir/config.json" --head "$dir/head.safetensors" \
        ${STEPS:+--steps "$STEPS"} --init "$model" ${HELD:+--validation "$HELD"} \
        -o "$dir/run" $RECORDS &&
        spid-train -q -c "$dir/config.json" --head "$dir/head.safetensors" \
            --join "$dir/model.safetensors" "$model" "$dir/run/model.safetensors" || return
    if [ ${#clips[@]} -gt 0 ]; then
        tables=()
        LACKS=$1 SPID_MODEL=$dir/model.safetensors reenacted "$name" -s -c
        rows self psnr ssim lpips arcface aed akd | sed -n "1p; s|^$name\*|$row|p" |
            stamped "$data" | sed 1d >>"$out/table3.tsv"
    fi
    [ -z "${HELD:-}" ] || awk -F '\t' -v OFS='\t' -v row="$row" '
        NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; print; next }
        { last = row OFS $at["psnr_star"] OFS $at["ssim_star"] }
        END { print last, "-", "-", "-", "-", "-" }' "$dir/run/held.tsv" |
        stamped "${HELD##*/}" | sed 1d >>"$out/table3.tsv"
}

if [ -n "${RECORDS:-}" ]; then
    model=${SPID_MODEL:-$here/model/model.safetensors}
    for seed in ${SEEDS:-1 2}; do
        for part in nothing dynamic static interp mouth neck; do
            trained $part "$seed" 2>"$out/run/trained.log" ||
                failed "table 3 without $part, seed $seed" "$out/run/trained.log"
        done
    done
else
    missing "table 3, trained on without each part" "training records (RECORDS)"
fi

# ---- time -------------------------------------------------------------------

plot=$out/tradeoff.svg
if ! command -v gnuplot >/dev/null; then
    plot=$out/tradeoff.gp
    missing tradeoff.svg "gnuplot (apt: gnuplot-nox); tradeoff.gp is its script"
fi
if spid-bench -q -s "${BENCH:-20}" --plot "$plot" -o "$out/bench.txt" splat motion refine pipeline 2>"$out/run/bench.log"; then
    { echo "# commit $commit, a made person, $machine"
      sed -n '/^Phase B/,$p' "$out/bench.txt"; } >"$out/latency.txt"
else
    failed "latencies and trade-off" "$out/run/bench.log"
fi

for table in 1 2 3; do
    [ -e "$out/table$table.tsv" ] && printf 'Table %s\n' $table && cat "$out/table$table.tsv" && echo
done >"$out/paper.txt"
{ cat "$out/latency.txt"; echo; sort -u "$out/missing"; } >>"$out/paper.txt"
rm "$out/missing"
cat "$out/paper.txt"
exit $bad
