#!/usr/bin/env bash
# one.sh SOURCE DRIVER OUT: animate one clip, unless OUT is there already.
# What array jobs and GNU parallel call; a clip that was cut short has no OUT
# and is made again.
set -euo pipefail
source=$1 driver=$2 out=$3
[ -e "$out" ] && exit 0
mkdir -p "$(dirname "$out")"
exec spid-animate -q -j "${OMP_NUM_THREADS:-1}" ${SPID_ANIMATE_FLAGS:-} \
    "$source" "$driver" -o "$out"
