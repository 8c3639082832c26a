# spid-bench: its rows as a table, JSON, TSV and a picture.
load helper

prepare() {
    BENCH=(spid-bench -j 1 -s 0.2 motion)
}

@test "JSON has the machine, and time beside error in every row" {
    "${BENCH[@]}" --json -o bench.json
    need_numpy
    "$PYTHON" - <<'PY'
import json
b = json.load(open("bench.json"))
assert set(b["machine"]) == {"cpu", "isa", "threads"}, b["machine"]
keys = {"stage", "config", "knob", "threads", "ms_min", "ms_median", "ms_p95", "max_abs", "psnr_db", "pareto"}
assert len(b["rows"]) >= 4
for r in b["rows"]:
    assert set(r) == keys, r
    assert 0 <= r["ms_min"] <= r["ms_median"] <= r["ms_p95"], r
    assert r["max_abs"] is None or r["max_abs"] < 0.1, r
assert {"crop", "motion", "heads"} <= {r["stage"] for r in b["rows"]}
assert any(r["pareto"] for r in b["rows"])
PY
}

@test "the table has a heading and a front, TSV a line for each row" {
    "${BENCH[@]}" -o bench.txt
    grep -q '^stage .* Pareto$' bench.txt
    grep -q '^motion .*\*$' bench.txt
    "${BENCH[@]}" --tsv -o bench.tsv
    grep -q $'^# isa\t' bench.tsv
    [ "$(grep -v '^#' bench.tsv | awk -F '\t' '{ print NF }' | sort -u)" = 10 ]
    [ "$(grep -vc '^#' bench.tsv)" -ge 5 ]
}

@test "the picture's script; the picture where there is gnuplot, a clear line where not" {
    "${BENCH[@]}" --plot cost.gp -o /dev/null
    grep -q 'set logscale xy' cost.gp
    grep -q '"bf16' cost.gp
    bench=$(command -v spid-bench)
    PATH=/nowhere status 69 "$bench" -j 1 -s 0.2 --plot cost.png -o /dev/null motion
    one_line
    has "gnuplot-nox"
    [ ! -e cost.png ]
    [ ! -e cost.part.png ]
    command -v gnuplot >/dev/null || skip "no gnuplot (apt: gnuplot-nox)"
    "${BENCH[@]}" --plot cost.png -o /dev/null
    [ "$(head -c 4 cost.png | tail -c 3)" = PNG ]
}

@test "shared times programs alone and beside others, and leaves none running" {
    TMPDIR=$PWD spid-bench -j 1 -s 0.1 --tsv -o shared.tsv shared
    for program in "spid-motion" "spid-animate --star"; do
        awk -F '\t' -v p="$program, " '
            index($2, p) == 1 { ms[$3] = $5 }
            END { exit !(ms["alone"] > 0 && ms["beside 1 busy loop"] > 0) }' shared.tsv
    done
    no compgen -G "spid-bench-*"
    ! pgrep -f "$PWD/spid-bench-"
}

@test "misuse is exit 64, a model that is not there 66" {
    status 64 spid-bench
    status 64 spid-bench --json --tsv motion
    status 64 spid-bench nothing
    has "motion"
    status 66 spid-bench -m nowhere.safetensors motion
}
