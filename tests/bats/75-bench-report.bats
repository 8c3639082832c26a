# spid-bench: its rows as a table, JSON, TSV and a picture.
load helper

prepare() {
    HARD=(spid-bench -j 1 -s 0.2 hard)
}

@test "JSON has the machine, and time beside error in every row" {
    "${HARD[@]}" --json -o bench.json
    need_numpy
    "$PYTHON" - <<'PY'
import json
b = json.load(open("bench.json"))
assert set(b["machine"]) == {"cpu", "isa", "threads"}, b["machine"]
keys = {"stage", "config", "knob", "threads", "ms_min", "ms_median", "ms_p95", "max_abs", "psnr_db", "pareto", "hard"}
assert len(b["rows"]) >= 20
for r in b["rows"]:
    assert set(r) == keys, r
    assert r["hard"] and 0 < r["ms_min"] <= r["ms_median"] <= r["ms_p95"], r
    assert r["max_abs"] < 0.1, r
assert {"rotation", "crop", "flame", "splat"} <= {r["stage"] for r in b["rows"]}
PY
}

@test "the table has a section of hard cases, TSV a line for each row" {
    "${HARD[@]}" -o bench.txt
    grep -q '^Hard cases$' bench.txt
    grep -q 'needles' bench.txt
    "${HARD[@]}" --tsv -o bench.tsv
    grep -q $'^# isa\t' bench.tsv
    [ "$(grep -v '^#' bench.tsv | awk -F '\t' '{ print NF }' | sort -u)" = 11 ]
    [ "$(grep -vc '^#' bench.tsv)" -ge 21 ]
}

@test "the picture's script; the picture where there is gnuplot, a clear line where not" {
    "${HARD[@]}" --plot cost.gp -o /dev/null
    grep -q 'set logscale xy' cost.gp
    grep -q '"needles 1:10000"' cost.gp
    bench=$(command -v spid-bench)
    PATH=/nowhere status 69 "$bench" -j 1 -s 0.2 --plot cost.png -o /dev/null hard
    one_line
    has "gnuplot-nox"
    [ ! -e cost.png ] && [ ! -e cost.part.png ]
    command -v gnuplot >/dev/null || skip "no gnuplot (apt: gnuplot-nox)"
    "${HARD[@]}" --plot cost.png -o /dev/null
    [ "$(head -c 4 cost.png | tail -c 3)" = PNG ]
}

@test "misuse is exit 64, a model that is not there 66" {
    status 64 spid-bench
    status 64 spid-bench --json --tsv hard
    status 64 spid-bench nothing
    has "hard"
    status 66 spid-bench -m nowhere.safetensors hard
}

@test "growth: a row for each point, exponents; nothing is left behind" {
    mkdir tmp
    TMPDIR=$PWD/tmp spid-bench -j 1 -s 1 -o growth growth
    [ -z "$(ls tmp)" ]
    for of in bytes Gaussians pixels threads; do
        grep -Eq "^growth +[0-9.e+]+ $of \\(" growth
    done
    grep -Eq '^growth, Gaussians 10000 to .*: time ~ x\^[0-9.]+ \(r2' growth
    # a reader holds no more than a record of a stream, however long
    grep ' bytes (spid-dump' growth | grep -o 'peak [0-9]*' >peaks
    awk '$2 > 200 { exit 1 }' peaks
}
