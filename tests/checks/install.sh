#!/usr/bin/env bash
# make install puts programs, pages and models where they are found.
set -euo pipefail
cd "${TOP:-$(dirname "$0")/../..}"
[ "${BUILD:-build}" = build ] || { echo "only for the plain build"; exit 77; }
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
make -s install DESTDIR="$dir" PREFIX=/opt/spid

for f in build/bin/*; do
    p=$dir/opt/spid/bin/$(basename "$f")
    [ -x "$p" ] || { echo "FAILED not installed: $f"; exit 1; }
    [[ $("$p" --version) == "$(basename "$f") "* ]] || { echo "FAILED $p --version"; exit 1; }
done
for f in media.so video.so filter.so http.so; do
    [ -x "$dir/opt/spid/lib/spid/$f" ] || { echo "FAILED not installed: the module $f"; exit 1; }
done
for f in man/*; do
    [ -r "$dir/opt/spid/share/man/man${f##*.}/$(basename "$f")" ] || { echo "FAILED not installed: $f"; exit 1; }
done
for f in build/share/spid/*; do
    [ ! -e "$f" ] || cmp "$f" "$dir/opt/spid/share/spid/$(basename "$f")"
done
# Nothing lands outside the prefix.
outside=$(find "$dir" -type f -not -path "$dir/opt/spid/*")
[ -z "$outside" ] || { echo "FAILED outside the prefix: $outside"; exit 1; }
echo "$(find "$dir" -type f | wc -l) files"
