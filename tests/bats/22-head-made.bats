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

@test "with the scans' shapes anew it is as close to them; a head elsewhere is refused" {
    SCANS=${SPID_ASSETS:-$TOP/../shared/assets}/ict/ict.safetensors
    [ -e "$SCANS" ] || skip "no scans in the shared assets (SPID_ASSETS)"
    spid-head --from "$SCANS" -o h.safetensors
    spid-head --check "$SCANS" >shipped
    spid-head --head h.safetensors --check "$SCANS" >anew
    # mean distances of face, lids and lips
    paste shipped anew | grep -v head | awk -F '\t' '$3 != "part" { n++; if ($12 > 1.05 * $5) bad = 1 }
        END { exit bad || n != 9 }'
    other_head up.safetensors
    status 65 spid-head --head up.safetensors --from "$SCANS" -o x.safetensors
    has "does not lie on the scans"
    [ ! -e x.safetensors ]
}

@test "a subdivided head: the same face on a finer mesh, moved by a person's offset" {
    need_numpy
    spid-head --subdivide -o fine.safetensors
    motion 2
    spid-flame motion.spid -o coarse.spid
    spid-flame --head fine.safetensors motion.spid -o fine.spid
    "$PYTHON" -c '
import numpy as np
np.save("beta.npy", np.zeros(300, "f4"))
np.save("move.npy", np.tile(np.array([0, 0.25, 0], "f4"), (20366, 1)))
np.save("short.npy", np.zeros((20365, 3), "f4"))'
    spid-pack -t SHAP shape=beta.npy offset=move.npy -o me.spid
    spid-flame --head fine.safetensors -i me.spid motion.spid -o moved.spid
    for s in coarse fine moved; do spid-dump --npy $s $s.spid; done
    "$PYTHON" - <<'PY'
import numpy as np
coarse, fine, moved = (np.load(f"{s}/MESH.verts.npy")
                       for s in ("coarse", "fine", "moved"))
assert fine.shape == (2, 20366, 3)
assert np.abs(fine[:, :5140] - coarse).max() < 2e-6
way = moved[0] - fine[0]        # the jaw is closed: nothing turns it
assert np.abs(way - [0, 0.25, 0]).max() < 2e-6, way
PY
    spid-pack -t SHAP shape=beta.npy offset=short.npy -o short.spid
    status 65 spid-flame --head fine.safetensors -i short.spid motion.spid -o x.spid
    has "short.spid: SHAP offset has 20365 rows (expected 20366, one for each of the head's vertices)"
    one_line
    status 64 spid-head --subdivide --from fine.safetensors -o x.safetensors
    status 66 spid-head --subdivide --head none.safetensors -o x.safetensors
    one_line
    [ ! -e x.spid ] && [ ! -e x.safetensors ]
}
