#!/usr/bin/env bash
# reenact.sh [-s] [-n FRAMES] -o DIR CLIP...: the paper's two protocols, each
# clip an identity.  The source is the first frame of a clip.
#   self    its driver is the same clip; the truth its frames and its motion
#   cross   its driver is the next clip (the first after the last)
# -s makes SpiD* (no refiner).  -n takes only the first frames of each clip, all
# of a shorter one.
#   DIR/truth/NAME    frames of the clip's portrait window, and NAME.spid
#   DIR/self, DIR/cross   results, and the motion found in them
#   DIR/pairs.tsv     what spid-eval --pairs reads; its table is printed
# The row "frame 0 unchanged" is the source itself in place of every later frame.
# A portrait window may reach past the edges of its clip, where the truth is
# unknown (black here).  Frames are compared inside the driver's clip alone, in
# folders DIR/*/NAME.inside, and the share of the window that this is is said.
# A clip that fails is named, left out of the pairs, and makes the exit 1.
set -uo pipefail
star= frames= out=
while getopts sn:o: option; do
    case $option in
    s) star=1 ;;
    n) frames="-frames:v $OPTARG" ;;
    o) out=$OPTARG ;;
    *) exit 64 ;;
    esac
done
shift $((OPTIND - 1))
[ -n "$out" ] && [ $# -gt 0 ] || { sed -n '2s/^# //p' "$0" >&2; exit 64; }
method=SpiD${star:+*}
mkdir -p "$out"/{truth,self,cross,person}
: >"$out/pairs.tsv"
bad=0

# conf FILE KEY...: numbers of a stream's CONF, blanks between.
conf() {
    spid-dump --json --only CONF "$1" | python3 -c '
import json, sys
values = json.loads(json.loads(sys.stdin.readline())["arrays"][0]["text"])[sys.argv[1]]
print(*(values.values() if isinstance(values, dict) else values))' "$2"
}

# truth CLIP NAME: its portrait window as pictures, its motion, its avatar.
truth() {
    local clip=$1 name=$2 x y side size width height
    spid-motion -q "$clip" -o "$out/person/$name.whole.spid" || return
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
        "format=rgb24,pad=iw+2*$side:ih+2*$side:$side:$side,crop=$side:$side:$((x + side)):$((y + side)),scale=$size:$size:flags=area" \
        "$out/truth/$name/%05d.png" || return
    window=$((size / 2)),$((size / 2)),$size
    # the source is the clip's own picture: black beside it would be its background
    ffmpeg -nostdin -v error -y -i "$clip" -frames:v 1 -pix_fmt rgb24 "$out/person/$name.png" &&
        spid-motion -q --window "$window" "$out/truth/$name" -o "$out/truth/$name.spid" &&
        spid-shape -q --window "$((x + side / 2)),$((y + side / 2)),$side" "$out/person/$name.png" -o "$out/person/$name.me.spid" &&
        spid-branches -q --bake "$out/person/$name.me.spid" -o "$out/person/$name.spid"
}

# drive PERSON DRIVER DIR: that person moved by that clip.
drive() {
    local person=$out/person/$1 made=$3/$1 channels
    channels=$(spid-dump "$person.spid" | sed -n 's/^ *color .*\[[0-9]*,\([0-9]*\)\].*/\1/p' | head -n 1)
    mkdir -p "$made"
    spid-flame -i "$person.spid" "$out/truth/$2.spid" | spid-branches -i "$person.spid" |
        if [ -n "$star" ]; then
            spid-splat -q -s "$size" -o "$made/%05d.png"
        else
            spid-splat -q -s "$size" -c "$channels" | spid-refine -q -i "$person.me.spid" \
                --background source -o "$made/%05d.png"
        fi &&
        spid-motion -q --window "$window" "$made" -o "$made.spid"
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

# judged PROTOCOL PERSON DRIVER: two lines of the pairs file.
judged() {
    local truth made
    truth=$(inside "$out/truth/$3" "$3") && made=$(inside "$out/$1/$2" "$3") || return
    printf '%s\t%s\t%s\t%s\t%s\t%s\n' \
        "$method" frames "$truth" "$made" "$1" "$out/truth/$2/00001.png" \
        "$method" motion "$out/truth/$3.spid" "$out/$1/$2.spid" "$1" "$out/truth/$2/00001.png" \
        >>"$out/pairs.tsv"
}

names=()
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
    for protocol in self cross; do
        driver=$name
        [ $protocol = self ] || driver=$next
        [ $protocol = self ] || [ "$next" != "$name" ] || continue
        if ! drive "$name" "$driver" "$out/$protocol" ||
            ! judged $protocol "$name" "$driver"; then
            echo "reenact.sh: $name driven by $driver: left out" >&2
            bad=1
        fi
    done
done
spid-eval --pairs "$out/pairs.tsv" || bad=1
exit $bad
