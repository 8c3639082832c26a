#!/usr/bin/env bash
# A program that needs no heavy library links none.
set -uo pipefail
cd "${TOP:-$(dirname "$0")/../..}"
bin=${BUILD:-build}/bin
fail=0
# allow PROGRAM PATTERN: what it may link besides libc and the compiler's own.
check() {
    local heavy
    heavy=$(ldd "$bin/$1" | awk '{ print $1 }' |
        grep -E 'opencv|OpenImageIO|dnnl|tinygltf|mpi|png' | grep -vE "${2:-^$}")
    [ -z "$heavy" ] || { echo "FAILED $1 links $(tr '\n' ' ' <<<"$heavy")"; fail=1; }
}
check spid-dump
check spid-pack
check spid-flame
[ ! -e "$bin/spid-branches" ] || check spid-branches dnnl
# Pictures and videos come with the module.
for program in "$bin"/*; do
    ! ldd "$program" | grep -E 'OpenImageIO|opencv_videoio|avcodec' ||
        { echo "FAILED $program links these"; fail=1; }
done
echo "links checked"
exit $fail
