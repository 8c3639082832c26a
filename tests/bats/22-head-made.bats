# spid-head: a sculpted head, a head of scans, and scans that are not.
load helper

scans_head() {
    SCANS=$TOP/examples/model/head-scans.safetensors
    [ -e "$SCANS" ] || skip "no head of the scans"
}

@test "the same head every time" {
    spid-head -o a.safetensors
    spid-head -o b.safetensors
    cmp a.safetensors b.safetensors
}

@test "a head of the scans poses a stream, and its hash is not the default's" {
    scans_head
    motion 2
    spid-flame --head "$SCANS" motion.spid -o scans.spid
    spid-flame --head "$TOP/${BUILD:-build}/share/spid/head.safetensors" \
        motion.spid -o own.spid
    spid-dump --check scans.spid
    [ "$(spid-dump --json --only MESH scans.spid | wc -l)" -eq 2 ]
    run cmp -s scans.spid own.spid
    [ "$status" -eq 1 ]
}

@test "a model refuses the head of the scans" {
    scans_head
    [ -e "$TOP/examples/model/model.safetensors" ] || skip "no model shipped"
    status 78 spid-branches --head "$SCANS" --bake nothing.spid -o x.spid
    has "model was made for head"
}

@test "scans that are missing, cut or something else are named" {
    run spid-head --from nothing.safetensors -o h.safetensors
    [ "$status" -eq 66 ]
    [[ $output == *nothing.safetensors* ]]
    head -c 1000 "$TOP/examples/model/model.safetensors" >cut.safetensors
    run spid-head --from cut.safetensors -o h.safetensors
    [ "$status" -eq 65 ]
    [[ $output == *cut.safetensors* ]]
    spid-head -o head.safetensors
    run spid-head --from head.safetensors -o h.safetensors
    [ "$status" -eq 65 ]
    [[ $output == *head.safetensors*neutral* ]]
    run spid-head --head head.safetensors --check head.safetensors
    [ "$status" -eq 65 ]
    [ ! -e h.safetensors ]
}

@test "--head goes with neither -o nor --from" {
    run spid-head --head x -o y
    [ "$status" -eq 64 ]
    run spid-head --head x --from y
    [ "$status" -eq 64 ]
}
