# spid-eval --features: fid and kid against numpy, by covariances and their
# product's eigenvalues, and by pairs.
load helper

prepare() { need_numpy; }

# figures: "fid kid" of a.npy and b.npy.
figures() {
    spid-eval -q -f tsv --features a.npy b.npy |
        awk -F '\t' 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i } NR == 2 { print $c["fid"], $c["kid"] }'
}

# features NA NB DIM TYPE: a.npy and b.npy, and what numpy says of them.
features() {
    "$PYTHON" - "$@" <<'P'
import sys
import numpy as np
na, nb, dim = map(int, sys.argv[1:4])
rng = np.random.default_rng(na + nb)
mix = rng.normal(size=(dim, dim))
a = rng.normal(size=(na, dim)).astype(sys.argv[4])
b = (rng.normal(size=(nb, dim)) @ mix * .3 + .5).astype(sys.argv[4])
np.save("a.npy", a), np.save("b.npy", b)
a, b = a.astype("f8"), b.astype("f8")
root = np.sqrt(np.maximum(np.linalg.eigvals(np.cov(a.T) @ np.cov(b.T)).real, 0)).sum()
fid = ((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(np.cov(a.T)) + np.trace(np.cov(b.T)) - 2 * root
k = lambda x, y: (x @ y.T / dim + 1) ** 3
off = lambda x: (k(x, x).sum() - np.trace(k(x, x))) / (len(x) * (len(x) - 1))
print(fid, off(a) + off(b) - 2 * k(a, b).mean())
P
}

@test "more rows than numbers, fewer, and either" {
    for how in "60 40 8 f4" "6 9 30 f8" "5 50 12 f4" "50 5 12 f2"; do
        # shellcheck disable=SC2086
        features $how >want
        figures >have
        paste have want
        awk '{ d = $1 - $3; e = $2 - $4; if (d < 0) d = -d; if (e < 0) e = -e
               exit !($3 > 0.1 && d < 1e-6 * $3 && e < 1e-6 * ($4 < 0 ? -$4 : $4)) }' <(paste have want)
    done
}

@test "equal sets are nowhere apart" {
    features 30 20 6 f8 >/dev/null
    cp a.npy b.npy
    figures | awk '{ exit !($1 < 1e-9 && $1 > -1e-9) }'
}

@test "what is no set of features is refused by name" {
    "$PYTHON" -c '
import numpy as np
np.save("a.npy", np.ones((3, 4)))
np.save("one.npy", np.ones((1, 4)))
np.save("wide.npy", np.ones((3, 5)))
np.save("cube.npy", np.ones((3, 4, 2)))
x = np.ones((3, 4)); x[2, 1] = np.nan
np.save("nan.npy", x)'
    for bad in one cube; do
        status 65 spid-eval --features a.npy $bad.npy
        has "$bad.npy: no features (expected numbers [N,dim]"
    done
    status 65 spid-eval --features a.npy wide.npy
    has "wide.npy: 5 numbers a row (expected 4 as in a.npy)"
    status 65 spid-eval --features nan.npy a.npy
    has "nan.npy: row 2: not finite"
    status 66 spid-eval --features a.npy none.npy
    echo junk >junk.npy
    status 65 spid-eval --features a.npy junk.npy
}
