#!/usr/bin/env bash
# demo.sh OUT: a head that talks and blinks, without a camera or a model.
# `make demo` runs it with the programs just built.
set -euo pipefail
out=${1:?usage: demo.sh OUT}
mkdir -p "$out"

# Motion by hand: 50 frames, the jaw opens twice, the eyes close once, the head
# turns by 0.2 rad to either side.  R = diag(1,-1,-1) Ry(turn).
awk 'BEGIN {
    for (i = 0; i < 50; i++) {
        t = 6.2831853 * i / 50; turn = 0.2 * sin(t)
        exp_ = "0"
        for (k = 1; k < 100; k++) exp_ = exp_ ",0"
        blink = i > 20 && i < 28 ? 1 - (i - 24)^2 / 16 : 0
        printf "{\"type\":\"MOTN\",\"arrays\":{"
        printf "\"rot\":[[%f,0,%f],[0,-1,0],[%f,0,%f]],", \
            cos(turn), sin(turn), sin(turn), -cos(turn)
        printf "\"trans\":[0,0,12],\"exp\":[%s],", exp_
        printf "\"jaw\":[%f,0,0],\"lid\":[%f,%f],", \
            0.15 * (1 - cos(2 * t)), blink, blink
        print "\"eye\":[0,0,0,0,0,0]}}"
    }
}' >"$out/motion.json"

spid-pack "$out/motion.json" -o "$out/motion.spid"
spid-flame "$out/motion.spid" -o "$out/mesh.spid"
spid-dump --check "$out/mesh.spid"
spid-dump --only MESH --frames 24 "$out/mesh.spid"
