#!/usr/bin/env bats
# The library in a program of one's own: installed, found by pkg-config, used.
load helper

@test "examples/embed.c builds against what is installed and draws a head that turns" {
    command -v pkg-config >/dev/null || skip "no pkg-config (apt: pkg-config)"
    [ -z "${BUILD##build}" ] || [ -z "$BUILD" ] || skip "only for the plain build (no SANITIZE)"
    make -s -C "$TOP" install DESTDIR="$PWD/root" PREFIX=/opt/spid
    export PKG_CONFIG_PATH=$PWD/root/opt/spid/lib/pkgconfig
    flags=$(pkg-config --define-variable=prefix="$PWD/root/opt/spid" --cflags --libs spid)
    # for C++ too, and alone
    echo '#include <spid.h>' | ${CXX:-c++} -x c++ -fsyntax-only $flags - 2>&1
    ${CC:-cc} -Wall -Wextra -Werror "$TOP/examples/embed.c" -o embed $flags -lm
    export LD_LIBRARY_PATH=$PWD/root/opt/spid/lib
    [ "$(readelf -d embed | grep -c 'NEEDED.*libspid.so.0')" -eq 1 ]
    # and without the shared library
    all=$(pkg-config --static --define-variable=prefix="$PWD/root/opt/spid" --cflags --libs spid)
    ${CC:-cc} "$TOP/examples/embed.c" -o alone ${all/-lspid/-l:libspid.a} -lm
    spid-synth -q --seed 32 --first 0 --people 1 --frames 1 --effects 0 -o me.png
    export SPID_MODEL=$PWD/root/opt/spid/share/spid/model.safetensors
    ./embed me.png >turn.pam
    ./alone me.png | cmp - turn.pam
    ffmpeg -nostdin -v error -f pam_pipe -i turn.pam f%02d.png
    [ "$(ls f*.png | wc -l)" -eq 25 ]
    # frame 7 has turned; the head is still there
    run ffmpeg -nostdin -i f01.png -i f07.png -lavfi "[0]format=rgb24[a];[1]format=rgb24[b];[a][b]psnr" -f null -
    db=$(sed -n 's/.*average:\([0-9.inf]*\).*/\1/p' <<<"$output")
    awk -v db="$db" 'BEGIN { exit !(db > 8 && db < 30) }'
    status 1 ./embed none.png
    one_line
    has "none.png"
}
