# spid-head: plain arrays, a head laid on scans, and scans that are not.
load helper

@test "plain arrays: the same head, the same bytes every time" {
    spid-head -o a.safetensors
    spid-head -o b.safetensors
    cmp a.safetensors b.safetensors
    motion 2
    spid-flame motion.spid -o packed.spid
    spid-flame --head a.safetensors motion.spid -o plain.spid
    spid-dump --check plain.spid
    [ "$(spid-dump --json --only MESH plain.spid | wc -l)" -eq 2 ]
    cmp packed.spid plain.spid
}

@test "a model refuses another head" {
    [ -e "$TOP/examples/model/model.safetensors" ] || skip "no model shipped (make model)"
    other_head other.safetensors
    status 78 spid-branches --head other.safetensors --bake nothing.spid -o x.spid
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

@test "a head to start from that is missing or another mesh is named" {
    status 66 spid-head --head nothing.safetensors -o h.safetensors
    has nothing.safetensors
    status 65 spid-head --head "$TOP/examples/model/model.safetensors" -o h.safetensors
    has model.safetensors
    status 64 spid-head --from scans.safetensors
    has "no output file"
    [ ! -e h.safetensors ]
}

@test "laid on the scans anew it lies on them as closely" {
    SCANS=${SPID_ASSETS:-$TOP/../shared/assets}/ict/ict.safetensors
    [ -e "$SCANS" ] || skip "no scans in the shared assets (SPID_ASSETS)"
    spid-head --from "$SCANS" -o h.safetensors
    spid-head --check "$SCANS" >shipped
    spid-head --head h.safetensors --check "$SCANS" >anew
    # mean distances of face, lids and lips
    paste shipped anew | grep -v head | awk -F '\t' '$3 != "part" { n++; if ($12 > 1.05 * $5) bad = 1 }
        END { exit bad || n != 9 }'
}
