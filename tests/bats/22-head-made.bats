# spid-head: a sculpted head, a head of scans, and scans that are not.
load helper

scans_head() {
    SCANS=$TOP/examples/model/head.safetensors
    [ -e "$SCANS" ] || skip "no head of the scans (make model)"
}

@test "the same head every time" {
    spid-head -o a.safetensors
    spid-head -o b.safetensors
    cmp a.safetensors b.safetensors
}

@test "a head of the scans poses a stream, and not as the sculpted one does" {
    scans_head
    motion 2
    spid-flame --head "$SCANS" motion.spid -o scans.spid
    spid-head -o sculpted.safetensors
    spid-flame --head sculpted.safetensors motion.spid -o own.spid
    spid-dump --check scans.spid
    [ "$(spid-dump --json --only MESH scans.spid | wc -l)" -eq 2 ]
    run cmp -s scans.spid own.spid
    [ "$status" -eq 1 ]
}

@test "a model refuses the sculpted head" {
    [ -e "$TOP/examples/model/model.safetensors" ] || skip "no model shipped (make model)"
    spid-head -o sculpted.safetensors
    status 78 spid-branches --head sculpted.safetensors --bake nothing.spid -o x.spid
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
