#!/usr/bin/env bats
# spid live -o http://127.0.0.1:PORT: pictures for browsers and OBS.
load helper

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    spid-synth -q --seed 32 --first 0 --people 1 --frames 1 --effects 0 -o me.png
    spid-shape -q me.png -o me.spid
    spid-branches -q --bake me.spid -o avatar.spid
    spid-synth -q --seed 31 --first 2 --people 1 --frames 10 --effects 0 --size 256 -o driver.y4m
}

setup() {
    cd "$BATS_TEST_TMPDIR"
    ln -s "$BATS_FILE_TMPDIR"/*.* .
    PORT=$((20000 + RANDOM % 20000))
}

# start [OPTION...]: spid live at $PORT with frames until it is stopped.
start() {
    mkfifo frames
    spid-live -q -s avatar.spid frames -o "http://127.0.0.1:$PORT" "$@" 2>live.err &
    LIVE=$!
    # the header once, then frames without end
    { cat driver.y4m; while tail -c +"$(($(head -1 driver.y4m | wc -c) + 1))" driver.y4m; do :; done; } \
        >frames 2>/dev/null &
    FEED=$!
    for _ in $(seq 150); do
        (exec 7<>"/dev/tcp/127.0.0.1/$PORT") 2>/dev/null && return
        sleep .2
    done
    cat live.err
    false
}

teardown() {
    [ -z "$FEED" ] || kill "$FEED" 2>/dev/null || true
    [ -z "$LIVE" ] || kill "$LIVE" 2>/dev/null || true
}

# get PATH [HOST]: the answer's status and headers, then a blank line, the body.
get() {
    exec 7<>"/dev/tcp/127.0.0.1/$PORT"
    printf 'GET %s HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n' "$1" "${2:-127.0.0.1:$PORT}" >&7
    timeout 60 cat <&7
    exec 7<&- 7>&-
}

@test "pictures go on and on, the newest is a JPEG that says it is synthetic" {
    start
    timeout 120 ffmpeg -nostdin -v error -f mpjpeg -i "http://127.0.0.1:$PORT/live.mjpg" -frames:v 5 s%d.png
    ls s5.png
    run ffprobe -v error -show_entries stream=width,height -of csv=p=0 s5.png
    has "512,512"
    get /picture.jpg >picture
    grep -aq '^HTTP/1.1 200' picture
    grep -aqi 'content-type: image/jpeg' picture
    grep -aq 'ynthetic' picture
    run get /
    has '<img src="live.mjpg"'
    kill -TERM "$LIVE"
    wait "$LIVE"
    LIVE=
}

@test "another name, another path and another method are refused" {
    start
    run get / evil.example
    has "403"
    run get /etc/passwd
    has "404"
    exec 7<>"/dev/tcp/127.0.0.1/$PORT"
    printf 'POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\nConnection: close\r\n\r\n' >&7
    run timeout 20 cat <&7
    has "405"
}

@test "other machines are refused unless told, and bad addresses are one line" {
    status 64 spid-live -q avatar.spid driver.y4m -o "http://0.0.0.0:$PORT"
    one_line
    has "--public"
    for bad in http://127.0.0.1 http://127.0.0.1:0 http://127.0.0.1:99999 http://here:80 \
        http://127.0.0.1:80/x; do
        status 64 spid-live -q avatar.spid driver.y4m -o "$bad"
        one_line
        has "expected http://127.0.0.1:PORT"
    done
}

@test "an address that is taken is one line" {
    start
    status 69 spid-live -q avatar.spid driver.y4m -o "http://127.0.0.1:$PORT"
    one_line
    has "cannot listen"
}
