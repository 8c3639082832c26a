#!/usr/bin/env bash
# Every header compiles alone, twice over, as C and (formats/) as C++.
set -uo pipefail
cd "${TOP:-$(dirname "$0")/../..}"
fail=0 count=0
flags="-fsyntax-only -Wall -Wextra -Werror -I. -D_GNU_SOURCE"
flags="$flags -DSPID_VERSION=\"0\" -DSPID_DATADIR=\"/\" $(pkg-config --cflags libcjson)"
for h in $(git ls-files '*.h' 2>/dev/null || find cmd lib formats tests -name '*.h'); do
    [ -e "$h" ] || continue
    count=$((count + 1))
    printf '#include "%s"\n#include "%s"\n' "$h" "$h" |
        ${CC:-cc} -std=gnu17 $flags -x c - || { echo "FAILED $h does not compile alone"; fail=1; }
    grep -q '^#ifndef SPID_' "$h" || { echo "FAILED $h has no SPID_ guard"; fail=1; }
    case $h in formats/*)
        printf 'extern "C" {\n#include "%s"\n}\n' "$h" |
            ${CXX:-c++} -std=c++17 $flags -x c++ - || { echo "FAILED $h is not C++"; fail=1; } ;;
    esac
done
echo "$count headers"
exit $fail
