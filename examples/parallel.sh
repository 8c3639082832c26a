#!/usr/bin/env bash
# parallel.sh LIST [JOBS]: every line of LIST is SOURCE, DRIVER and OUT with
# tabs between.  One clip per core; a clip that was killed is tried again
# (one.sh), and what is there already is left, so run it again to go on where
# it stopped.  Ends with how many clips are there; 1 when one is missing.
# To make such a list of all pairs:
#   for s in people/*.jpg; do for d in clips/*.mp4; do
#       printf '%s\t%s\tout/%s-%s.mp4\n' "$s" "$d" \
#           "$(basename "$s" .jpg)" "$(basename "$d" .mp4)"
#   done; done > list.tsv
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
list=$1 jobs=${2:-$(nproc)}

# Two jobs of one name would write into each other's file.
twice=$(cut -f 3 "$list" | sort | uniq -d | head -n 1)
[ -z "$twice" ] || {
    echo "parallel.sh: $list: $twice is made twice" >&2
    exit 65
}
if command -v parallel >/dev/null && parallel --version | grep -q GNU; then
    parallel -j "$jobs" --colsep '\t' --joblog "$list.log" --retries 2 \
        "$here/one.sh" {1} {2} {3} <"$list" || true
else
    # xargs does the same, less the log; it would stop at a job that is killed
    tr '\t\n' '\0\0' <"$list" | xargs -0 -n 3 -P "$jobs" \
        bash -c '"$0" "$@" || exit 1' "$here/one.sh" || true
fi

missing=0 all=0
while IFS=$'\t' read -r _ _ out; do
    all=$((all + 1))
    [ -e "$out" ] || missing=$((missing + 1))
done <"$list"
echo "parallel.sh: $((all - missing)) of $all clips are there" >&2
[ "$missing" -eq 0 ]
