#!/usr/bin/env bash
# parallel.sh LIST [JOBS]: every line of LIST is SOURCE, DRIVER and OUT with
# tabs between.  One clip per core; run it again to go on where it stopped.
# To make such a list of all pairs:
#   for s in people/*.jpg; do for d in clips/*.mp4; do
#       printf '%s\t%s\tout/%s-%s.mp4\n' "$s" "$d" \
#           "$(basename "$s" .jpg)" "$(basename "$d" .mp4)"
#   done; done > list.tsv
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
list=$1 jobs=${2:-$(nproc)}
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
if command -v parallel >/dev/null && parallel --version | grep -q GNU; then
    exec parallel -j "$jobs" --colsep '\t' --joblog "$list.log" \
        --halt soon,fail=20% "$here/one.sh" {1} {2} {3} < "$list"
fi
# without GNU parallel: xargs does the same, less the log
tr '\t\n' '\0\0' < "$list" | xargs -0 -n 3 -P "$jobs" "$here/one.sh"
