#!/usr/bin/env bats
# Many short clips by the recipes, some of them killed: SPID_JOBS clips (24; 200
# in `make soak`), SPID_JOB_KILLS killed (3; 10).
load helper
load animate

prepare() {
    animate_files
    spid-motion -q -j 1 -m model drive.y4m -o motion.spid
    # what is begun, what is lost and what is made, in a log: who kills cannot
    # know whether the process had ended before
    mkdir bin
    cat >bin/spid-animate <<END
#!/usr/bin/env bash
for out; do :; done
echo "\$\$ \$out" >>"$PWD/begun"
"$(command -v spid-animate)" "\$@" &
echo \$! >>"$PWD/running"
wait \$! || { rc=\$?; echo "\$out" >>"$PWD/lost"; exit \$rc; }
echo "\$out" >>"$PWD/made"
END
    chmod +x bin/spid-animate
    export PATH=$PWD/bin:$PATH
}

# killer N: N clips that run, at random moments.
killer() {
    local n=0 pid
    while [ $n -lt "$1" ]; do
        sleep 0.$((RANDOM % 9 + 1))
        pid=$(tail -n 1 running 2>/dev/null) || true
        if [ -n "$pid" ] && kill -KILL "$pid" 2>/dev/null; then
            n=$((n + 1))
        fi
        [ ! -e finished ] || break
    done
}

@test "clips killed at random: none is lost, none made twice" {
    local jobs=${SPID_JOBS:-24} i
    RANDOM=${SPID_SEED:-7}
    for ((i = 0; i < jobs; i++)); do
        printf 'avatar.spid\tmotion.spid\tout/%d.y4m\n' $i
    done >list
    export SPID_ANIMATE_FLAGS="-s --size 64 -m $PWD/model" SPID_PAUSE=0
    export SPID_TRIES=$((1 + ${SPID_JOB_KILLS:-3}))
    killer "${SPID_JOB_KILLS:-3}" 3>&- &
    "$TOP/examples/parallel.sh" list 2 2>said || { cat said; return 1; }
    touch finished
    wait $!
    cat said
    echo "$(wc -l <lost) killed, $(wc -l <begun) begun, $(wc -l <made) made"
    [ "$(wc -l <lost)" -gt 0 ]
    [ "$(wc -l <begun)" -eq $((jobs + $(wc -l <lost))) ]
    [ "$(sort -u made | wc -l)" -eq "$jobs" ]
    [ "$(wc -l <made)" -eq "$jobs" ]
    for ((i = 1; i < jobs; i++)); do
        cmp out/0.y4m out/$i.y4m
    done
    [ "$(find out -type f | wc -l)" -eq "$jobs" ]
    grep -q "$jobs of $jobs clips are there" said

    # nothing is left to do
    "$TOP/examples/parallel.sh" list 2
    [ "$(wc -l <made)" -eq "$jobs" ]
}

@test "a list that names a clip twice is refused" {
    printf 'a\tb\tone.y4m\nc\td\tone.y4m\n' >list
    status 65 "$TOP/examples/parallel.sh" list
    has "one.y4m is made twice"
}
