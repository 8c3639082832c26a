load helper

prepare() { motion 4; }

# overwrite FILE OFFSET BYTES
overwrite() {
    printf "$3" | dd of="$1" bs=1 seek="$2" conv=notrunc status=none
}

@test "a cut stream ends with 65, one line and the last good frame" {
    size=$(stat -c %s motion.spid)
    for cut in 64 100 1200; do
        head -c $((size - cut)) motion.spid >cut.spid
        status 65 spid-dump -q cut.spid
        [[ ${lines[-1]} == \
            "spid-dump: cut.spid: after frame "[23]": "* ]]
        status 65 spid-dump --check cut.spid
        one_line
        head -c $((size - cut)) motion.spid >fifo_in
        run bash -c 'cat fifo_in | spid-dump --check'
        [ "$status" -eq 65 ]
        [[ $output == "spid-dump: <stdin>: after frame "[23]": "* ]]
    done
}

@test "a stream without END keeps its complete frames" {
    head -c -64 motion.spid >cut.spid
    status 65 spid-dump --safetensors kept.safetensors cut.spid
    has 'after frame 3: no END record, the writer stopped early'
    spid-pack --raw kept.safetensors -o kept.spid
    cmp kept.spid motion.spid
    status 65 spid-pack cut.spid -o whole.spid
    [ ! -e whole.spid ]
    [ -s whole.spid.part ]
}

@test "a flipped bit, a wrong magic and a newer version are told apart" {
    cp motion.spid a.spid && overwrite a.spid 1000 '\x55'
    status 65 spid-dump --check a.spid
    has 'checksum'
    cp motion.spid b.spid && overwrite b.spid 0 'RIFF'
    status 65 spid-dump --check b.spid
    [ "$output" = "spid-dump: b.spid: not a record: it starts with 'RIFF' (expected 'SPID')" ]
    cp motion.spid c.spid && overwrite c.spid 4 '\x02'
    status 65 spid-dump --check c.spid
    has 'header checksum'
}

@test "an empty input, a directory, a terminal and no file at all" {
    status 65 spid-dump --check /dev/null
    has 'empty input (expected a stream)'
    status 66 spid-dump .
    has 'is a directory (expected a stream)'
    status 66 spid-dump no-such-file
    has 'no-such-file: cannot open'
    command -v script >/dev/null || skip "no script(1) (apt: bsdutils)"
    run script -qec 'spid-dump; echo "status $?"' /dev/null </dev/null
    has 'is a terminal'
    has 'status 64'
    run script -qec 'spid-pack motion.spid; echo "status $?"' /dev/null
    has 'will not write binary records to a terminal'
    has 'status 64'
}

@test "records larger than --max-bytes are refused" {
    status 65 spid-dump --max-bytes 500 motion.spid
    has 'bytes (at most 500, see --max-bytes)'
    status 0 spid-dump -c --max-bytes 1M motion.spid
}

@test "a full disk is an error" {
    [ -w /dev/full ] || skip "no /dev/full (Linux)"
    run bash -c 'spid-pack motion.spid >/dev/full'
    [ "$status" -eq 74 ]
    one_line
    has 'No space left on device'
    run bash -c 'spid-dump motion.spid >/dev/full'
    [ "$status" -eq 74 ]
    status 74 spid-pack motion.spid -o /dev/full
    status 73 spid-pack motion.spid -o no/such/dir
    status 73 spid-pack motion.spid -o .
}

@test "a reader that closes early ends the writer quietly" {
    motion 9 long.spid
    for i in 1 2 3 4 5 6 7 8; do
        spid-pack long.spid long.spid long.spid long.spid -o more.spid
        mv more.spid long.spid
        [ "$(stat -c %s long.spid)" -lt 4000000 ] || break
    done
    run bash -c 'spid-pack long.spid 2>err | head -c 1000 >/dev/null
        echo "${PIPESTATUS[0]}"'
    [ "$output" -eq 141 ]
    [ ! -s err ]
    run bash -c 'spid-dump long.spid 2>err | head -n 1 >/dev/null
        echo "${PIPESTATUS[0]}"'
    [ "$output" -eq 141 ]
    [ ! -s err ]
}

@test "unknown records and arrays pass through" {
    echo '{"type":"XYZW","arrays":{"what":[1,2]}}' >u.json
    spid-pack u.json motion.spid -o u.spid
    status 0 spid-dump -c u.spid
    spid-pack u.spid | spid-dump --json --only XYZW >out.json
    grep -q '"what"' out.json
}

@test "a named output appears only when it is complete" {
    mkfifo pipe
    spid-pack - -o out.spid <pipe &
    exec 4>pipe
    head -c 1000 motion.spid >&4
    [ ! -e out.spid ]
    tail -c +1001 motion.spid >&4
    exec 4>&-
    wait $!
    cmp out.spid motion.spid
    [ ! -e out.spid.part ]
}
