#!/usr/bin/env bash
# reenact.sh [-stc] [-n FRAMES] [-e N] -o DIR CLIP...: the paper's two
# protocols, each clip an identity.  The source is the first frame of a clip.
#   self    its driver is the same clip; the truth its frames and its motion
#   cross   its driver is the next clip (the first after the last); -c: not run
# -s makes SpiD* (no refiner, over black or BACKGROUND); $SPID_MODEL may be of
# another METHOD (the row's name); EVAL: options of spid-eval.
# WITHOUT names parts of spid-branches, blanks between: self once more for each, as
# method "w/o PART", whose avatars lack it (the paper's ablations; not trained anew).
# LACKS says that the model's own avatars lack a part: no face need be found in them.
# -n takes only the first frames of each clip, all of a shorter one; -e every
# N-th.  -t (--turned) starts each clip at its most turned frame, as spid-motion
# finds it, and goes on to the farther end, be it backwards.  --split NAME takes
# the clips of that split (model/splits.tsv, below $SHARED, by default the folder
# shared beside the checkout).
#   DIR/truth/NAME    frames of the clip's portrait window, and NAME.spid
#   DIR/self, DIR/cross, DIR/without-PART   results, and the motion found in them
#   DIR/pairs.tsv     what spid-eval --pairs reads; its table is printed
#   DIR/judge.tsv     without the ablations, what $JUDGE (shared's tools/judge/judge.mjs by default) reads
#   DIR/judge.json, judge.txt   and says, where that is installed
# The row "frame 0 unchanged" is the source itself in place of every later frame.
# A portrait window may reach past the edges of its clip, where the truth is
# unknown (black here).  Frames are compared inside the driver's clip alone, in
# folders DIR/*/NAME.inside, and the share of the window that this is is said.
# A clip that fails is named, left out of the pairs, and makes the exit 1; how
# many sources were refused is said.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
shared=${SHARED:-$here/../../shared}
judge=${JUDGE:-$shared/tools/judge/judge.mjs}
star= frames= out= turned= every=1 protocols='self cross' split=
for word; do        # long options into short ones
    shift
    case $word in
    --turned) set -- "$@" -t ;;
    --split) set -- "$@" -S ;;
    *) set -- "$@" "$word" ;;
    esac
done
while getopts stcn:e:o:S: option; do
    case $option in
    s) star=1 ;;
    t) turned=1 ;;
    c) protocols=self ;;
    n) frames="-frames:v $OPTARG" ;;
    e) every=$OPTARG ;;
    o) out=$OPTARG ;;
    S) split=$OPTARG ;;
    *) exit 64 ;;
    esac
done
shift $((OPTIND - 1))
if [ -n "$split" ]; then
    while read -r name; do
        set -- "$@" "$shared/$name"
    done < <(awk -F '\t' -v s="$split" '$1 == s && $2 == "clip" { print $3 }' \
        "$here/model/splits.tsv")
fi
[ -n "$out" ] && [ $# -gt 0 ] || { sed -n '2,3s/^# //p' "$0" >&2; exit 64; }
background=${BACKGROUND:-$([ -n "$star" ] && echo black || echo source)}
method=${METHOD:-SpiD}${star:+*}${turned:+ turned}
mkdir -p "$out"/{truth,self,cross,person}
: >"$out/pairs.tsv"
: >"$out/judge.tsv"
bad=0

# conf FILE KEY...: numbers of a stream's CONF, blanks between.
conf() {
    spid-dump --json --only CONF "$1" | python3 -c '
import json, sys
values = json.loads(json.loads(sys.stdin.readline())["arrays"][0]["text"])[sys.argv[1]]
print(*(values.values() if isinstance(values, dict) else values))' "$2"
}

# start MOTION: number of the most turned frame, and of the last one.
start() {
    spid-dump --json --values --only MOTN "$1" | python3 -c '
import json, sys
facing = []
for line in sys.stdin:
    arrays = {a["name"]: a for a in json.loads(line).get("arrays", [])}
    if "rot" in arrays:
        facing.append(-arrays["rot"]["data"][8])
print(facing.index(min(facing)), len(facing) - 1)'
}

# chosen MOTION: ffmpeg filter of the frames that are taken, the first first.
chosen() {
    local at=0 last=0
    [ -z "$turned" ] || read -r at last < <(start "$1")
    if [ $((2 * at)) -gt "$last" ]; then
        echo "select=lte(n\\,$at)*not(mod($at-n\\,$every)),reverse"
    else
        echo "select=gte(n\\,$at)*not(mod(n-$at\\,$every))"
    fi
}

# truth CLIP NAME: its portrait window as pictures, its motion, its identity.
truth() {
    local clip=$1 name=$2 x y side size width height take
    spid-motion -q "$clip" -o "$out/person/$name.whole.spid" || return
    take=$(chosen "$out/person/$name.whole.spid")
    # whole pixels: ffmpeg cuts exactly what the encoder then sees
    read -r x y side < <(conf "$out/person/$name.whole.spid" window |
        awk '{ s = int($3 / 2) * 2; printf "%d %d %d\n", $1 - s / 2 + .5, $2 - s / 2 + .5, s }')
    read -r size _ < <(conf "$out/person/$name.whole.spid" camera)
    read -r width height < <(conf "$out/person/$name.whole.spid" picture)
    # its part inside the clip: width, height, corner in window pixels; percent
    awk -v x="$x" -v y="$y" -v side="$side" -v n="$size" -v w="$width" -v h="$height" '
        function at(t, lo, hi) { return (t < lo ? lo : t > hi ? hi : t) * n / side }
        function up(t) { return int(t) + (t > int(t)) }
        BEGIN {
            l = up(at(-x, 0, side)); t = up(at(-y, 0, side))
            r = int(at(w - x, 0, side)); b = int(at(h - y, 0, side))
            printf "%d %d %d %d %.1f\n", r - l, b - t, l, t, 100 * (r - l) * (b - t) / (n * n)
        }' >"$out/truth/$name.inside.txt"
    mkdir -p "$out/truth/$name"
    # shellcheck disable=SC2086
    ffmpeg -nostdin -v error -y -i "$clip" $frames -fps_mode passthrough -vf \
        "$take,format=rgb24,pad=iw+2*$side:ih+2*$side:$side:$side,crop=$side:$side:$((x + side)):$((y + side)),scale=$size:$size:flags=area" \
        "$out/truth/$name/%05d.png" || return
    window=$((size / 2)),$((size / 2)),$size
    # the source is the clip's own picture: black beside it would be its background
    ffmpeg -nostdin -v error -y -i "$clip" -vf "$take" -frames:v 1 -pix_fmt rgb24 "$out/person/$name.png" &&
        spid-motion -q --window "$window" "$out/truth/$name" -o "$out/truth/$name.spid" &&
        { spid-shape -q --window "$((x + side / 2)),$((y + side / 2)),$side" "$out/person/$name.png" -o "$out/person/$name.me.spid" ||
            { refused=$((refused + 1)); false; }; }
}

# drive PERSON DRIVER DIR [PART]: that person, without that part, moved by that clip.
# A face need not be found in what lacks one.
drive() {
    local made=$3/$1 who=$out/person/$1.me.spid

    mkdir -p "$made"
    rm -f "$made.spid"
    if [ -n "${4:-}" ]; then
        spid-branches -q --bake "$who" --without "$4" -o "$3/$1.avatar.spid" || return
        who=$3/$1.avatar.spid
    fi
    spid-animate -q --absolute ${star:+--star} -b "$background" "$who" \
        "$out/truth/$2.spid" -o "$made/%05d.png" &&
        { spid-motion -q --window "$window" "$made" -o "$made.spid" || [ -n "${4:-}${LACKS:-}" ]; }
}

# inside FRAMES DRIVER: the name of these frames' part inside the driver's clip.
inside() {
    local w h x y
    read -r w h x y _ <"$out/truth/$2.inside.txt"
    if [ "$w" = "$size" ] && [ "$h" = "$size" ]; then
        echo "$1"
        return
    fi
    mkdir -p "$1.inside"
    ffmpeg -nostdin -v error -y -i "$1/%05d.png" -vf "crop=$w:$h:$x:$y" "$1.inside/%05d.png" &&
        echo "$1.inside"
}

# judged PROTOCOL PERSON DRIVER DIR: two lines of the pairs file.
judged() {
    local truth made
    truth=$(inside "$out/truth/$3" "$3") && made=$(inside "$4/$2" "$3") || return
    printf '%s\t%s\t%s\t%s\t%s\t%s\n' \
        "$method" frames "$truth" "$made" "$1" "$out/truth/$2/00001.png" >>"$out/pairs.tsv"
    [ ! -e "$4/$2.spid" ] || printf '%s\t%s\t%s\t%s\t%s\t%s\n' \
        "$method" motion "$out/truth/$3.spid" "$4/$2.spid" "$1" "$out/truth/$2/00001.png" >>"$out/pairs.tsv"
    [ "$4" = "$out/$1" ] || return 0
    printf '%s\t%s\t%s\n' "$out/truth/$2/00001.png" "$out/truth/$3" "$4/$2" \
        >>"$out/judge.tsv"
}

names=() refused=0
for clip; do
    name=$(basename "${clip%.*}")
    if truth "$clip" "$name"; then
        names+=("$name")
        read -r _ _ _ _ share <"$out/truth/$name.inside.txt"
        [ "$share" = 100.0 ] ||
            echo "reenact.sh: $name: $share % of the window lies in the clip; only that is compared" >&2
    else
        echo "reenact.sh: $clip: left out" >&2
        bad=1
    fi
done
for i in "${!names[@]}"; do
    name=${names[i]} next=${names[(i + 1) % ${#names[@]}]}
    read -r size _ < <(conf "$out/truth/$name.spid" camera)
    window=$((size / 2)),$((size / 2)),$size
    for protocol in $protocols; do
        driver=$name
        [ $protocol = self ] || driver=$next
        [ $protocol = self ] || [ "$next" != "$name" ] || continue
        if ! drive "$name" "$driver" "$out/$protocol" ||
            ! judged $protocol "$name" "$driver" "$out/$protocol"; then
            echo "reenact.sh: $name driven by $driver: left out" >&2
            bad=1
        fi
    done
    whole=$method
    for part in ${WITHOUT:-}; do
        method="w/o $part"
        if ! drive "$name" "$name" "$out/without-$part" "$part" ||
            ! judged self "$name" "$name" "$out/without-$part"; then
            echo "reenact.sh: $name without $part: left out" >&2
            bad=1
        fi
    done
    method=$whole
done
echo "reenact.sh: $refused of $# sources refused" >&2
# shellcheck disable=SC2086
spid-eval ${EVAL:-} --pairs "$out/pairs.tsv" || bad=1
if [ -f "$judge" ] && [ -d "${JUDGE_NODE:-$HOME/.cache/judge_node}" ]; then
    node "$judge" pairs "$out/judge.tsv" --json "$out/judge.json" |
        tee "$out/judge.txt" || bad=1
else
    echo "reenact.sh: no judge (${judge%/*}/setup.sh installs it)" >&2
fi
exit $bad
