#!/usr/bin/env bats
# spid-live for long: SPID_SOAK minutes (0.15 in `make check`, 30 in `make
# soak`).
load helper
load animate

prepare() {
    live_files
}

# hashes: of a Y4M from standard input, a line for each picture.
hashes() {
    python3 -c '
import hashlib, sys
y4m = sys.stdin.buffer
head = y4m.readline().split()
w, h = (int(v[1:]) for k in b"WH" for v in head if v[0] == k)
c = [v for v in head if v[:1] == b"C"]
size = w * h * 3 if c and c[0].startswith(b"C444") else w * h * 3 // 2
while y4m.readline():
    picture = y4m.read(size)
    assert len(picture) == size, "a picture that is not whole"
    print(hashlib.sha256(picture).hexdigest(), flush=True)
'
}

# watch PID: its private memory in kB, every half second, once a few pictures
# have been shown.
watch() {
    local kb
    while kb=$(sed -n 's/^RssAnon:[^0-9]*\([0-9]*\) kB/\1/p' \
        "/proc/$1/status" 2>/dev/null) && [ -n "$kb" ]; do
        [ "$(wc -l <shown)" -lt 12 ] || echo "$kb"
        sleep 0.5
    done
}

# small_pages COMMAND...: with pages of 4 kB alone: where the kernel gathers
# them into one of 2 MB, memory grows that nobody asked for.
small_pages() {
    exec python3 -c '
import ctypes, os, sys
PR_SET_THP_DISABLE = 41
assert ctypes.CDLL(None).prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0) == 0
os.execvp(sys.argv[1], sys.argv[1:])' "$@"
}

@test "driven for long: memory flat, no frame lost, the same bytes at the end" {
    seconds=$(awk "BEGIN { print int(60 * ${SPID_SOAK:-0.15}) }")
    mkfifo frames pictures
    # -re alone is early at each loop's end
    LOOPS=-1 camera -t "$seconds" -vf realtime >frames &
    hashes <pictures >shown &
    sink=$!
    small_pages spid-live -m model -s -j 1 --patience 0 avatar.spid - \
        <frames >pictures 2>said &
    live=$!
    : >>shown
    watch $live >memory
    wait $live
    wait $sink
    cat said

    n=$(sed -n 's/^spid-live: \([0-9]*\) frames.*/\1/p' said)
    dropped=$(sed -n 's/.*, \([0-9]*\) dropped.*/\1/p' said)
    echo "$seconds s: $n shown, $dropped dropped, $(sort -u shown | wc -l)" \
        "different pictures"
    [ "$(wc -l <shown)" -eq "$n" ]
    [ $((n + dropped)) -eq $((10 * seconds)) ]

    # from there on nothing grows; a busy machine may show too few
    [ -s memory ] || [ "$n" -le 20 ]
    awk 'NR == 1 { low = $1 }
        $1 > most { most = $1 }
        $1 < low { low = $1 }
        END {
            print "private memory: " low " to " most " kB, " NR " looks"
            exit most - low > 1024
        }' memory

    # the crop follows the frames before, so that a dropped one changes the
    # next; but what the end shows has been shown
    head -n -8 shown | sort -u >before
    tail -n 8 shown | sort -u >last
    [ -z "$(comm -13 before last)" ] || [ "$dropped" -gt 0 ]
}
