#!/bin/sh
# train-time.sh LOG: how long the paper's training would take on 1, 8 and 64
# machines, from the line that spid-train ends with,
#     spid-train: 2 steps, 20.00 s a step (8.0 passes of 2.00 s, 340.0 MB
#     summed in 0.00 s), at most 9.70 GB
# measured on one such machine for a few steps.  A step there is its passes, a
# person each and shared out, then a ring all-reduce of what is summed, then
# the update, which every machine makes alike:
#     ceil(BATCH / n) pass + 2 (n - 1) / n bytes / bandwidth
#                          + 2 (n - 1) latency + rest
# Only pass, bytes and rest are measured; network and ring are a model.  More
# machines than BATCH have nothing to do: the last lines are for a batch of as
# many as machines and as many fewer steps, the same people in all, of which
# nothing says that it trains as well.
#
#   STEPS, BATCH   of the run (500000 and 8)
#   GIGABIT        of the network, each way (10); LATENCY in microseconds (50)
set -eu

[ $# = 1 ] || { sed -n '2,19s/^# \{0,1\}//p' "$0" >&2; exit 64; }
[ -r "$1" ] || { echo "train-time.sh: $1: cannot be read" >&2; exit 66; }
line=$(grep -E '^spid-train: [0-9]+ steps, .* MB summed in ' "$1" | tail -n 1)
[ -n "$line" ] || {
    echo "train-time.sh: $1: no line of spid-train's about its steps" >&2
    exit 65
}
echo "$line" | tr -d '(,' | awk -v steps="${STEPS:-500000}" \
    -v batch="${BATCH:-8}" -v gigabit="${GIGABIT:-10}" \
    -v latency="${LATENCY:-50}" '
function row(n, batch, steps,    most, sum, step) {
    most = int((batch + n - 1) / n)
    sum = 2 * (n - 1) / n * bytes / (gigabit * 1e9 / 8) \
        + 2 * (n - 1) * latency * 1e-6
    step = most * pass + sum + rest
    printf "%8d %6d %8d %10.2f %10.2f %10.1f\n", n, batch, steps, step, sum, \
        step * steps / 86400
}
{
    pass = $11; bytes = $13 * 1e6
    rest = $4 - $8 * pass - $17
    if (rest < 0)
        rest = 0
    printf "%8s %6s %8s %10s %10s %10s\n", "machines", "batch", "steps", \
        "s a step", "s summing", "days"
    for (n = 1; n <= 64; n *= 8)
        row(n, batch, steps)
    for (n = 8; n <= 64; n *= 8)
        if (n > batch)
            row(n, n, int(steps * batch / n))
}'
