#!/usr/bin/env bats
# spid-live: ffmpeg is the camera, through a pipe, a fifo and an address.
load helper
load animate

prepare() {
    live_files
}

# live ARGUMENT...: spid-live on the avatar; what it says is in `said`.
live() {
    timeout 200 spid-live -m model -s -j 1 avatar.spid "$@" 2>said || {
        local code=$?
        cat said
        return $code
    }
}

# pictures FILE: how many a Y4M holds.
pictures() { grep -ao FRAME "$1" | wc -l; }

@test "a camera through a pipe: every picture Y4M, the latency told" {
    camera | live - >out.y4m
    cat said
    [ "$(head -c 9 out.y4m)" = YUV4MPEG2 ]
    n=$(sed -n 's/^spid-live: \([0-9]*\) frame.*/\1/p' said)
    [ "$n" -gt 0 ]
    [ "$n" -le 12 ]
    [ "$(pictures out.y4m)" -eq "$n" ]
    grep -Eq 'dropped; latency p50 [0-9.]+ ms, p95 [0-9.]+ ms' said
}

@test "frames are dropped, not queued, when the reader is slow" {
    LOOPS=9 camera | live - | while head -c 60000 | grep -aq .; do sleep 0.5; done
    cat said
    dropped=$(sed -n 's/.*, \([0-9]*\) dropped.*/\1/p' said)
    [ "$dropped" -gt 0 ]
}

@test "a fifo whose writer ends and comes back with another size" {
    mkfifo frames
    live frames --frames 8 -o out.y4m 3>&- &    # more than the first gives
    reader=$!
    LOOPS=0 camera >frames
    sleep 0.3
    LOOPS=500 camera -vf scale=320:200 >frames 3>&- &   # it stops reading first
    writer=$!
    wait $reader
    kill $writer || true
    cat said
    [ "$(pictures out.y4m)" -ge 8 ]
    grep -q 'frames: no more frames; waiting for them' said
    grep -q 'frames: frame [0-9]*: frames again' said
}

@test "a face that goes is lost, the last motion held, and found again" {
    rm -f said
    # it comes and goes for as long as the program, which may start late, takes
    mkfifo face
    LOOPS=-1 camera -vf "drawbox=enable='gte(mod(n,60),30)':color=gray:t=fill" >face 3>&- &
    writer=$!
    live - -o out.y4m <face 3>&- &
    reader=$!
    for i in $(seq 900); do
        grep -qs 'face found again' said && break
        sleep 0.2
    done
    kill "$(pgrep -P $writer ffmpeg)"
    wait $reader
    cat said
    grep -q 'face lost' said
    grep -q 'face found again' said
}

@test "a file plays once, each frame at its time" {
    ffmpeg -v error -stream_loop 20 -i drive.y4m -pix_fmt yuv420p long.mkv
    length=$(ffprobe -v error -show_entries format=duration -of csv=p=0 long.mkv)
    total=$(ffprobe -v error -count_packets -show_entries stream=nb_read_packets \
        -of csv=p=0 long.mkv)
    begun=$EPOCHREALTIME
    live long.mkv -o long.y4m
    took=$(awk "BEGIN { print $EPOCHREALTIME - $begun }")
    cat said
    echo "$total frames, $length seconds, played in $took"
    awk "BEGIN { exit !($took > $length * ($total - 1) / $total) }"
    read -r n dropped < <(sed -n \
        's/^spid-live: \([0-9]*\) frame.* \([0-9]*\) dropped.*/\1 \2/p' said)
    [ $((n + dropped)) -eq "${total%,}" ]
    [[ $(<said) != *waiting* ]]
}

@test "an address; an interrupt ends it with a complete video" {
    ffmpeg -v error -stream_loop 20 -i drive.y4m -pix_fmt yuv420p clip.mkv
    live "file://$PWD/clip.mkv" --patience 100 -o out.mp4 &
    pid=$!
    for i in $(seq 100); do [ -s out.part.mp4 ] && break; sleep 0.2; done
    sleep 2
    kill -INT "$(pgrep -P "$(pgrep -P $pid)" spid-live ||
        pgrep -P $pid spid-live)"
    wait $pid
    cat said
    grep -q '^spid-live: [0-9]* frames' said
    ffprobe -v error -show_entries format_tags=comment -of csv=p=0 out.mp4 |
        grep -q 'Synthetic'
}

@test "an address that another program serves; one that is not there" {
    local port=$((20000 + RANDOM % 20000)) i
    ffmpeg -nostdin -v error -re -stream_loop -1 -r 10 -i drive.y4m -pix_fmt yuv420p \
        -f mpegts -listen 1 "http://127.0.0.1:$port" 3>&- &
    local server=$!
    for i in $(seq 100); do
        grep -q ":$(printf %04X $port) 00000000:0000 0A" /proc/net/tcp && break
        sleep 0.1
    done
    live "http://127.0.0.1:$port" --frames 3 -o out.y4m
    cat said
    [ "$(pictures out.y4m)" -eq 3 ]
    kill $server 2>/dev/null || true
    status 66 spid-live -q --patience 0 -m model -s avatar.spid \
        "http://127.0.0.1:$port" -o none.y4m
    one_line
    has "no video comes from there: Connection refused"
    [ ! -e none.y4m ]
}

@test "to another program: the recipe with mpegts" {
    camera | live - | ffmpeg -v error -i - -pix_fmt yuv420p -f mpegts out.ts
    [ "$(ffprobe -v error -count_frames -show_entries stream=nb_read_frames \
        -of csv=p=0 out.ts | head -n 1 | tr -d ,)" -gt 0 ]
}

@test "a preview in the terminal: half blocks, the cursor given back" {
    COLUMNS=40 LINES=12 live --preview --frames 2 drive.y4m >screen
    grep -aq $'\xe2\x96\x80' screen
    [ "$(tail -c 6 screen)" = $'\x1b[?25h' ]
    [ "$(tr -cd '\n' <screen | wc -c)" -le 44 ]
}

@test "what is no camera, no face, no video device: one line each" {
    status 66 spid-live -q -m model -s avatar.spid none.y4m --patience 0 -o o.y4m
    one_line
    has none.y4m
    ffmpeg -v error -f lavfi -i color=gray:s=64x64:r=5:d=1 grey.y4m
    status 65 spid-live -q -m model -s avatar.spid grey.y4m --patience 0 -o o.y4m
    one_line
    has 'grey.y4m: no face'
    status 73 spid-live -q -m model -s avatar.spid drive.y4m -o /dev/video99
    one_line
    has '/dev/video99: No such file'
    status 64 spid-live -q -m model -s avatar.spid drive.y4m -p -o o.mp4
    one_line
    [ ! -e o.y4m ]
}
