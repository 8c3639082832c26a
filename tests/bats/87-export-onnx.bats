#!/usr/bin/env bats
# spid-export --onnx: the networks as files for other engines.  That they
# compute what ours do is tests/unit/export_networks.c.
load helper

MODEL=$TOP/examples/model/model.safetensors

@test "onnx's checker accepts every network" {
    for python in python3 /usr/bin/python3; do
        "$python" -c 'import onnx' 2>/dev/null && break
        python=
    done
    [ -n "$python" ] || skip "no onnx (apt: python3-onnx)"
    spid-export -m "$MODEL" --onnx nets
    [ "$(ls nets | wc -l)" -eq 8 ]      # this model has no Phi_init
    "$python" - nets/*.onnx <<'PY'
import onnx, sys
for f in sys.argv[1:]:
    m = onnx.load(f)
    onnx.checker.check_model(m, full_check=True)
    assert m.doc_string and m.graph.input and m.graph.output, f
    print(f, [i.name for i in m.graph.input], [o.name for o in m.graph.output])
PY
}

@test "files are the same bytes twice, and a stream is not waited for" {
    timeout 60 spid-export -m "$MODEL" --onnx one
    spid-export -m "$MODEL" --onnx two </dev/null
    diff -r one two
}

@test "a folder that cannot be made is one line" {
    touch file
    status 73 spid-export -m "$MODEL" --onnx file/nets
    one_line
    has "file/nets: cannot create"
}
