#!/usr/bin/env bash
# Which folder includes which, from the lowest layer upwards.  Fails on a circle
# between folders, when lib/ or formats/ includes cmd/ or tests/, and when the
# runtime (lib/ but lib/lab, formats/, cmd/ but cmd/lab) includes the laboratory
# (lib/lab, cmd/lab).
set -uo pipefail
cd "${TOP:-$(dirname "$0")/../..}"

# "from to", once for each pair of folders.
edges() {
    grep -rE '^ *#include "[a-z]+/' --include='*.[ch]' --include='*.cc' \
        --include='*.hh' --include='*.inc' cmd formats lib |
        sed -E 's|^([^:]*)/[^/:]*: *#include "([^"]*)/[^/"]*".*|\1 \2|' |
        awk '$1 != $2' | sort -u
}

# Folders that include nothing any more come off, layer by layer; then those
# that nothing includes any more.  What stays is in a circle.
edges | awk '
    function peel(a, b, layer,    held, f, i, n, now) {
        for (;; layer++) {
            split("", held)
            split("", now)
            for (i = 1; i <= NR; i++)
                if (!(a[i] in off) && !(b[i] in off)) held[a[i]]
            n = 0
            for (f in folder)
                if (!(f in off) && !(f in held)) now[f] = ++n
            for (f in now) {
                off[f]
                if (layer >= 0) printf "%2d  %s:%s\n", layer, f, all[f]
            }
            if (!n) return
        }
    }
    { from[NR] = $1; to[NR] = $2; folder[$1]; folder[$2]; all[$1] = all[$1] " " $2 }
    $2 ~ /^(cmd|tests)/ && $1 !~ /^cmd/ ||
    $2 ~ /^(cmd|lib)\/lab/ && $1 !~ /^(cmd|lib)\/lab/ {
        printf "FAILED %s includes %s\n", $1, $2
        bad = 1
    }
    END {
        peel(from, to, 0)
        peel(to, from, -1000)
        for (i = 1; i <= NR; i++)
            if (!(from[i] in off) && !(to[i] in off)) {
                printf "FAILED circle: %s includes %s\n", from[i], to[i]
                bad = 1
            }
        exit bad
    }' | sort
exit "${PIPESTATUS[1]}"
