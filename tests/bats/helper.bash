# Shared by all pipe tests: a directory of its own for each test, the programs
# of this build.
TOP=${TOP:-$(cd "$BATS_TEST_DIRNAME/../.." && pwd)}
PATH=$TOP/${BUILD:-build}/bin:$PATH

setup() {
    cd "$BATS_TEST_TMPDIR" || exit 1
    if declare -F prepare >/dev/null; then prepare; fi
}

# status CODE COMMAND...: the command ends with exactly this exit status; its
# output is in $output, stderr included.
status() {
    local want=$1
    shift
    run "$@"
    [ "$status" -eq "$want" ] || {
        echo "exit status $status (expected $want): $*"
        echo "$output"
        return 1
    }
}

# no COMMAND...: the command fails; a test goes on after "! COMMAND" in any case.
no() {
    ! "$@" || {
        echo "expected to fail: $*"
        return 1
    }
}

# has TEXT: $output contains it.
has() {
    [[ $output == *"$1"* ]] || {
        echo "not in the output: $1"
        echo "$output"
        return 1
    }
}

# one_line: $output is a single line.
one_line() {
    [ "${#lines[@]}" -eq 1 ] || {
        echo "${#lines[@]} lines:"
        echo "$output"
        return 1
    }
}

# motion N [FILE]: a motion stream of N frames whose jaw opens.
motion() {
    local zeros i
    zeros=$(printf '0,%.0s' {1..99})0
    for ((i = 0; i < $1; i++)); do
        echo '{"type":"MOTN","arrays":{"rot":[[1,0,0],[0,-1,0],[0,0,-1]],' \
            '"trans":[0,0,12],"exp":['"$zeros"'],"jaw":[0.0'"$i"',0,0],' \
            '"lid":[0,0],"eye":[0,0,0,0,0,0]}}'
    done >motion-src.json
    spid-pack motion-src.json -o "${2:-motion.spid}"
}

# other_head FILE: the built-in head as plain arrays, but half a centimetre up and with an
# expression in the place of the lids', so that it is neither the model's nor the scans'.
other_head() {
    spid-head -q -o "$1"
    python3 - "$1" <<'P'
import json, struct, sys
with open(sys.argv[1], "r+b") as f:
    n = struct.unpack("<Q", f.read(8))[0]
    at = {k: [8 + n + x for x in v["data_offsets"]] for k, v in json.loads(f.read(n)).items() if k != "__metadata__"}
    first, last = at["v_template"]
    f.seek(first)
    x = list(struct.unpack(f"<{(last - first) // 4}f", f.read(last - first)))
    x[1::3] = [y + 0.005 for y in x[1::3]]
    f.seek(first)
    f.write(struct.pack(f"<{len(x)}f", *x))
    f.seek(at["shapedirs"][0] + 4 * (300 + 10))
    f.write(struct.pack("<f", 0.01))
P
}

# python: one with numpy, or the test is skipped.
need_numpy() {
    for PYTHON in python3 /usr/bin/python3; do
        "$PYTHON" -c 'import numpy' 2>/dev/null && return
    done
    skip "no numpy (apt: python3-numpy)"
}
