#!/usr/bin/env bats
# Programs of the pipe killed at random (SPID_KILLS of each, 1 in `make check`,
# 100 in `make soak`; the seed is SPID_SEED), disks that are full, places that
# cannot be written.
load helper
load animate

PIPE=(spid-motion spid-flame spid-branches spid-splat spid-refine)

prepare() {
    animate_files
    mkdir -p temporary
    export TMPDIR=$PWD/temporary
}

# run_pipe: the five programs side by side, a process each in pid[], until
# settle has seen them end.  What they say is in said.N.
run_pipe() {
    rm -rf out
    mkdir out
    rm -f link.*
    mkfifo link.{0..3}
    spid-motion -q -j 1 -m model long.y4m 2>said.0 >link.0 &
    pid[0]=$!
    spid-flame -q -j 1 -m model -i avatar.spid <link.0 2>said.1 >link.1 &
    pid[1]=$!
    spid-branches -q -j 1 -m model -i avatar.spid <link.1 2>said.2 >link.2 &
    pid[2]=$!
    spid-splat -q -j 1 -m model --channels 8 --covered <link.2 2>said.3 \
        >link.3 &
    pid[3]=$!
    spid-refine -q -j 1 -m model -o out/take.y4m <link.3 2>said.4 &
    pid[4]=$!
}

# settle: every process has ended; its status is in code[].
settle() {
    for i in {0..4}; do
        code[i]=0
        wait "${pid[i]}" || code[i]=$?
    done
}

milliseconds() { echo $(($(date +%s%N) / 1000000)); }

# patience: how many ms a program may take to notice: a second, times how many
# processes wait for each processor.
patience() {
    awk -v n="$(nproc)" '{ print int(1000 * (1 + $1 / n)) }' /proc/loadavg
}

# long_clip N: the clip's four pictures, N times.
long_clip() {
    head -n 1 drive.y4m >long.y4m
    for ((i = 0; i < $1; i++)); do
        tail -n +2 drive.y4m
    done >>long.y4m
}

# check_frames: what there is of the take is the beginning of the whole one,
# and whole pictures only, unless its own writer was killed.
check_frames() {
    local part=out/take.y4m.part size
    [ -e $part ] || return 0
    size=$(stat -c %s $part)
    [ "$size" -le "$(stat -c %s whole.y4m)" ]
    cmp -n "$size" $part whole.y4m
    [ "$1" = 4 ] || [ $(((size - head) % frame)) -eq 0 ]
}

# take_whole: the take stands under its own name, and it is all there.  So it
# does where a signal finds a program whose last record has left it.
take_whole() {
    [ -e out/take.y4m ] && cmp out/take.y4m whole.y4m
}

# check_codes K SIGNAL: who wrote to the dead one ends by SIGPIPE, who read
# from it says in a line that the stream is cut off.
check_codes() {
    local i
    for i in {0..4}; do
        if [ $i -eq "$1" ]; then
            [ "${code[i]}" -eq $((128 + $2)) ]
        elif [ $i -lt "$1" ]; then
            [ "${code[i]}" -eq 141 ] || [ "${code[i]}" -eq 0 ]
            [ ! -s said.$i ]
        else
            [ "${code[i]}" -eq 65 ]
            [ "$(wc -l <said.$i)" -eq 1 ]
        fi || {
            echo "${PIPE[$1]} killed by signal $2: ${PIPE[i]} ended with" \
                "${code[i]} and said: $(cat said.$i)"
            return 1
        }
    done
}

# kill_one K: once, at a moment that $RANDOM chooses.
kill_one() {
    local signal=$((RANDOM % 2 ? 9 : 15)) began took
    run_pipe
    sleep "$(awk "BEGIN { print $RANDOM / 32768 * $whole / 1000 }")"
    kill -$signal "${pid[$1]}" 2>/dev/null || true
    began=$(milliseconds)
    settle
    took=$(($(milliseconds) - began))
    if [ "${code[$1]}" -ne $((128 + signal)) ] || take_whole; then
        echo "too late: ${code[*]}"
        whole=$((whole / 2))    # the machine is less busy than it was
        return
    fi
    killed=$((killed + 1))
    [ $took -le "$(patience)" ] || {
        echo "the others took $took ms to end"
        return 1
    }
    check_codes "$1" $signal
    [ ! -e out/take.y4m ]
    check_frames "$1"
    [ -z "$(ls -A temporary)" ]
    [ -z "$(ls -A out | grep -v '^take.y4m.part$')" ]
}

@test "a program of the pipe killed at random: the others end, whole frames stay" {
    RANDOM=${SPID_SEED:-22}
    long_clip 5
    began=$(milliseconds)
    run_pipe
    settle
    whole=$(($(milliseconds) - began))
    [ "${code[*]}" = "0 0 0 0 0" ]
    mv out/take.y4m whole.y4m
    head=$(head -n 1 whole.y4m | wc -c)
    frame=$((($(stat -c %s whole.y4m) - head) / 20))
    killed=0
    for ((n = 0; n < ${SPID_KILLS:-1}; n++)); do
        for k in {0..4}; do
            kill_one "$k"
        done
    done
    echo "$killed killed"
    [ $killed -gt 0 ]
}

# writers: a line for each program that writes a file, whose name takes the
# place of @.
writers() {
    cat <<'END'
spid-shape -q -m model source.png -o @.spid
spid-shape -q -m model source.png -o /dev/null --overlay @.png
spid-branches -q -m model --bake me.spid -o @.spid
spid-motion -q -m model drive.y4m -o @.spid
spid-motion -q -m model drive.y4m -o /dev/null --arkit @.csv
spid-motion -q -m model drive.y4m -o /dev/null --overlay @.y4m
spid-flame -q -m model -i avatar.spid motion.spid -o @.spid
spid-branches -q -m model -i avatar.spid mesh.spid -o @.spid
spid-splat -q -m model gaus.spid -o @.y4m
spid-splat -q -m model gaus.spid -o @.png
spid-splat -q -m model gaus.spid -o @.pam
spid-splat -q -m model gaus.spid -o @.ppm
spid-splat -q -m model gaus.spid -o @.mp4
spid-splat -q -m model gaus.spid -f stream -o @.spid
spid-splat -q -m model --channels 8 --covered gaus.spid -o @.spid
spid-refine -q -m model feat.spid -o @.y4m
spid-refine -q -m model feat.spid -o @.mp4
spid-refine -q -m model feat.spid -o @.png
spid-animate -q -s -m model avatar.spid drive.y4m -o @.y4m
spid-animate -q -s -m model avatar.spid drive.y4m -o @.mp4
spid-live -q -s -m model --patience 0 avatar.spid drive.y4m -o @.y4m
spid-synth -q -n 1 --frames 2 --size 64 --head model/head.safetensors -o @.y4m
spid-synth -q -n 1 --frames 2 --size 64 --head model/head.safetensors -o @.spid
spid-pack motion.spid -o @.spid
spid-dump motion.spid -o @.txt
spid-dump --json --values motion.spid -o @.json
spid-dump --safetensors @.safetensors motion.spid
spid-dump --ply @.ply avatar.spid
spid-dump --npy @ motion.spid
spid-export avatar.spid --ply @.ply
spid-export avatar.spid --splat @.splat
spid-export avatar.spid --glb-splats @.glb
spid-export -i avatar.spid --glb-head @.glb --head model/head.safetensors motion.spid
spid-export --obj @.obj mesh.spid
spid-eval drive.y4m drive.y4m -o @.txt
spid-eval drive.y4m drive.y4m --frames-tsv @.tsv
spid-import table.npy -o @.safetensors
spid-splat -q -m model gaus.spid -o @.exr
spid-splat -q -m model gaus.spid -o @.mkv
spid-synth -q -n 1 --frames 1 --size 64 --head model/head.safetensors -o @.png
spid-head -q -o @.safetensors
spid-prepare -q -m model --frames 3 --least 2 --min-face 20 -o @ drive.y4m
spid-prepare -q -m model -o @ bad.mp4
spid-train -q -c motion.json --head model/head.safetensors -o @ people.spid
spid-report -q runs -o @.html
spid-report -q runs --sheet @.png -o /dev/null
spid-bench -q --tsv -s 0.1 -o @.tsv flame
spid-bench -q -j 1 -s 0.2 --plot @.gp -o /dev/null motion
spid-flame -q -m model -i avatar.spid motion.spid -o /dev/null --stats @.tsv
END
}

# refused LIMIT TARGET: every writer ends with 73 or 74 and one line, and
# leaves nothing under TARGET's name; whole frames may stay in TARGET.part, and
# in a folder its log, to which a line is added at a time.
# LIMIT, if not empty, is how many kilobytes a file may have.
refused() {
    local line rc bad=0 left
    while read -r line; do
        line=${line/@/$2}
        rc=0
        (
            [ -z "$1" ] || { trap '' XFSZ; ulimit -f "$1"; }
            timeout 60 bash -c "$line" 2>&1 >/dev/null
        ) </dev/null | cat >said || true
        rc=${PIPESTATUS[0]}
        left=$(find "$2"* -type f ! \( -name '*.part*' -size +0 \) \
            ! -name log.tsv ! -name held.tsv ! -name clips.tsv 2>/dev/null) || true
        [[ $rc = 7[34] && $(wc -l <said) -eq 1 && -z $left ]] || {
            echo "status $rc, said: $(cat said); left: $left"
            echo "    $line"
            bad=1
        }
        rm -rf "$2"* 2>/dev/null || true
    done < <(writers)
    return $bad
}

# What the writers read.
streams() {
    spid-motion -q -m model drive.y4m -o motion.spid
    spid-flame -q -m model -i avatar.spid motion.spid -o mesh.spid
    spid-branches -q -m model -i avatar.spid mesh.spid -o gaus.spid
    spid-splat -q -m model --channels 8 --covered gaus.spid -o feat.spid
    spid-dump --npy arrays motion.spid
    cp "$(find arrays -name '*.npy' | head -n 1)" table.npy
    spid-synth -q --people 2 --frames 2 --size 64 \
        --head model/head.safetensors -o people.spid
    cat >motion.json <<'END'
{"stage": "motion", "steps": 1, "batch": 2, "micro": 2, "rate": 1e-3,
 "pool": 2, "checkpoint_every": 1, "log_every": 1}
END
    echo 'no video' >bad.mp4
    mkdir runs
    cp drive.y4m runs/driver.y4m
    cp source.png runs
}

@test "no writer writes where nothing can be written" {
    streams
    refused "" /sys/kernel/take
}

@test "every writer notices a full disk" {
    streams
    mkdir full
    if mount -t tmpfs -o size=8k none full 2>/dev/null; then
        head -c 8192 /dev/zero >full/filler
        rc=0
        refused "" "$PWD/full/take" || rc=1
        umount full
        return $rc
    fi
    refused 0 "$PWD/full/take"      # no right to mount: files may not grow
}

@test "too little memory at any place is a line, not a crash" {
    # as much as it is of addresses: not under a sanitizer
    [ "${BUILD:-build}" = build ] || return 0
    for kb in $(seq 100000 10000 180000); do
        run bash -c "ulimit -c 0 -v $kb; exec spid-shape -q -j 2 \
            '$TOP/examples/photo.jpg' -o least.spid"
        echo "$kb: $status $output"
        [ "$status" -lt 128 ]
        one_line
    done
}
