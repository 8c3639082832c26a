#!/usr/bin/env bash
# one.sh SOURCE DRIVER OUT: animate one clip, unless OUT is there already.
# What array jobs and GNU parallel call; a clip that was cut short has no OUT
# and is made again, up to SPID_TRIES times (3) with a pause of SPID_PAUSE
# seconds (5) that doubles.  What more tries would not change, as a driver
# without a face, is tried once.  SPID_THREADS threads (1).
set -euo pipefail
source=$1 driver=$2 out=$3
[ -e "$out" ] && exit 0
mkdir -p "$(dirname "$out")"
pause=${SPID_PAUSE:-5}
for ((left = ${SPID_TRIES:-3}; ; left--)); do
    rc=0
    # shellcheck disable=SC2086
    spid-animate -q -j "${SPID_THREADS:-1}" ${SPID_ANIMATE_FLAGS:-} \
        "$source" "$driver" -o "$out" || rc=$?
    case $rc in 0 | 64 | 65 | 66 | 78) exit $rc ;; esac
    [ "$left" -gt 1 ] || exit 1
    sleep "$pause"
    pause=$((2 * pause))
done
