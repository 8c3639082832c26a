#!/bin/sh
# train-real.sh ASSETS [DIR]: a model for real people, start to end.  What
# `make model ASSETS=...` runs.  People of scans under real light, labelled
# photographs and clips, pairs of photographs as source and target, and at last
# the people of the photographs as avatars that act; of all these, those whose
# split is training (model/splits.tsv).  Everything lands in DIR
# (default build/train-real; 30 GB); a run that was stopped goes on where it
# was.  SEED, PEOPLE, ACTS (pictures of each avatar) and STEPS (of every stage,
# for a trial) change the size; in a trial, whose own model learns nothing, MATTE
# is one that cuts people out and finds faces.
set -eu

here=$(dirname "$0")
assets=$1
dir=${2:-build/train-real}
seed=${SEED:-1}
people=${PEOPLE:-8000}
chunks=8
mkdir -p "$dir"

# names OPTION SPLIT...: OPTION before each photograph and clip of these splits.
names() {
    option=$1
    shift
    for split; do
        awk -F '\t' -v s="$split" -v o="$option" \
            '$1 == s && $2 ~ /photos|clip/ { print o, $3 }' \
            "$here/model/splits.tsv"
    done
}

make_once() { # FILE COMMAND...: -o FILE is added
    file=$dir/$1
    shift
    [ -e "$file" ] || "$@" -o "$file"
}
synth() { # FILE PEOPLE FRAMES SIZE SEED EFFECTS OPTION...
    file=$1 n=$2 frames=$3 size=$4 number=$5 effects=$6
    shift 6
    make_once "$file" spid-synth --assets "$assets" --people "$n" \
        --frames "$frames" --size "$size" --seed "$number" \
        --effects "$effects" --fps 0.8 --without mesh \
        --head "$dir/head.safetensors" "$@"
}
fit() { # FILE MODEL OPTION...
    name=$1 model=$2
    shift 2
    # shellcheck disable=SC2046 # options without blanks
    make_once "$name" spid-fit --assets "$assets" --matte -m "$dir/$model" \
        $(names --except validation test) --same id2_vcd_swwp2s,pwij3p \
        --head "$dir/head.safetensors" "$@" \
        "$assets/labels/photos.safetensors" "$assets/labels/clips.safetensors"
}
pairs() { # FILE: neutral and smiling, frames of clips; validation's apart
    # shellcheck disable=SC2046
    make_once "$1" spid-fit --assets "$assets" --size 512 --plain --every 8 \
        $(names --except test) $(names --hold validation) \
        --matte -m "$dir/matte.safetensors" \
        --head "$dir/head.safetensors" --held "$dir/held-pairs.spid" \
        "$assets/labels/photos.safetensors" "$assets/labels/clips.safetensors"
}
train() { # NAME CONFIG HELD OPTIONS AND DATA
    name=$1 config=$dir/$1.json held=$3
    sed "s:\.\./shared/assets:$assets:" "$here/config/small-$2.json" \
        > "$config"
    shift 3
    spid-train -c "$config" -o "$dir/$name" --validation "$dir/$held" \
        --head "$dir/head.safetensors" ${STEPS:+--steps "$STEPS"} "$@"
}
join() { # FILE FIRST STAGE...
    file=$dir/$1 first=$2
    shift 2
    for stage; do
        set -- "$@" "$dir/$stage/model.safetensors"
        shift
    done
    spid-train -c "$here/config/small-avatar-photo.json" \
        --head "$dir/head.safetensors" --join "$file" \
        "$dir/$first/model.safetensors" "$@"
}

stand_in() { # NAME: in a trial
    [ -z "${MATTE:-}" ] || cp "$MATTE" "$dir/$1.safetensors"
}

[ -e "$dir/head.safetensors" ] || cp "$here/model/head.safetensors" "$dir"

# People of scans to learn from, in pieces that real ones come between, and
# others to be judged by.  Who is in a picture is learned first, from scans: so the
# people of photographs and clips are cut out, of whom it then learns.
faces='' mixed='' i=0
while [ $i -lt $chunks ]; do
    synth "faces-$i.spid" "$((people / chunks))" 1 256 \
        "$((60000 + 100 * seed + i))" 1
    faces="$faces $dir/faces-$i.spid"
    mixed="$mixed $dir/faces-$i.spid $dir/real.spid"
    i=$((i + 1))
done
synth held.spid 40 4 384 "$((90000 + seed))" 1
scenery=$(awk -F '\t' -v a="${assets%/}" \
    '$1 == "training" && $2 == "scenery" {
        sub(/^assets/, a, $3); print "--scenery", $3 }' \
    "$here/model/splits.tsv")
# shellcheck disable=SC2086 # a list of files
train matte matte held.spid $scenery $faces
join matte.safetensors matte
stand_in matte
fit real.spid matte.safetensors
synth held-512.spid 8 4 512 "$((91000 + seed))" 1
pairs pairs.spid
# shellcheck disable=SC2086
train matte-photos matte held.spid $scenery \
    --init "$dir/matte/model.safetensors" \
    $(echo "$mixed" | sed "s:$dir/real.spid:$dir/pairs.spid:g")
join matte.safetensors matte-photos
stand_in matte
some=''
for i in 1 2 3 4; do
    synth "people-$i.spid" "$((people / 160 + 1))" 4 512 \
        "$((80000 + 10 * seed + i))" 0.4
    some="$some $dir/people-$i.spid $dir/pairs.spid"
done

# pose and expression, shape, then branches and refiner through the photograph
# shellcheck disable=SC2086 # a list of files
train motion motion-real held.spid $mixed
# shellcheck disable=SC2086
train shape shape held.spid $mixed
# shellcheck disable=SC2086
train avatar avatar-photo held-512.spid $some
join first.safetensors avatar motion shape matte-photos

# what that model makes of the photographs, people who turn far (YAW:PITCH of
# each frame, other people in each piece), and pose and expression again
fit acts.spid first.safetensors --acts "${ACTS:-20}" \
    --motions "$dir/faces-0.spid"
turned='' far='' i=0
for turn in 55,-20:10,38:-25,-8 -62:-5,28,0:20,-45:12 70,-50,12:-15,-33:5 \
    42:8,-68,48:-12,-15 -38:-10,58:5,22,-5:-30 30:25,-55:-8,64,-26 \
    -72:4,35,-42,5:12 47,-30:-20,-60:6,18 75,-60:10,50:-25,-30:30 \
    -75,62:-12,-48:20,35:-35 68:15,-66,57,25:25 -70:-8,72:8,-58,-38:-20 \
    65,-63:5,55:18,0:-35 -68:12,60,-55,5:35; do
    make_once "turned-$i.spid" spid-synth --assets "$assets" \
        --people "$((people / 110 + 1))" --first "$((i * (people / 110 + 1)))" \
        --frames 4 --size 256 --seed "$((65000 + seed))" --effects 1 --fps 0.8 \
        --without mesh --head "$dir/head.safetensors" --turn "$turn"
    turned="$turned $dir/turned-$i.spid"
    far="$far $dir/turned-$i.spid $dir/faces-$((i % chunks)).spid"
    far="$far $dir/acts.spid $dir/real.spid"
    i=$((i + 1))
done
# shellcheck disable=SC2086
train motion-acts motion-acts held.spid \
    --init "$dir/motion/model.safetensors" \
    --shapes "$dir/first.safetensors" $far
fit real-256.spid matte.safetensors --size 256    # pictures of one size
# shellcheck disable=SC2086
train sure sure held.spid $scenery \
    --init "$dir/motion-acts/model.safetensors:motion.encoder." \
    "$dir/faces-0.spid" "$dir/real-256.spid" $turned
# what light falls on a face, of which the photographs say nothing
# shellcheck disable=SC2086
train light light held.spid $faces $turned
join faces.safetensors avatar motion-acts shape light sure matte-photos
stand_in faces

# what that encoder says of calm faces
rest=''
for photo in $(awk -F '\t' '$1 == "training" && /london/ { print $3 "neutral" }' \
    "$here/model/splits.tsv"); do
    make_once "rest-${photo##*/}.spid" spid-motion -q --no-align \
        -m "$dir/faces.safetensors" "$assets/${photo#assets/}.jpg"
    rest="$rest $dir/rest-${photo##*/}.spid"
done
mkdir -p "$dir/rest" "$dir/half"
# shellcheck disable=SC2086
python3 "$here/rest.py" "$dir/rest/model.safetensors" $rest
join found.safetensors avatar motion-acts shape light sure matte-photos rest
stand_in found

# the refiner meets the faults that shape and motions have where they are found
export SPID_MODEL=$dir/found.safetensors
turns='' i=0
for turn in 5,22,-38,-8,15 -35,24,-24,44,3 42,-20,10,-46,28 -12,35,-50,8,20; do
    synth "views-$i.spid" "$((people / 260 + 1))" 5 512 \
        "$((88000 + 10 * seed + i))" 0.4 --turn "$turn"
    turns="$turns $dir/views-$i.spid"
    i=$((i + 1))
done
# shellcheck disable=SC2086
[ -e "$dir/people-found.spid" ] ||
    python3 "$here/found.py" "$dir/people-found.spid" $turns "$dir/pairs.spid"
train refiner refiner-photo held-pairs.spid \
    --init "$dir/avatar/model.safetensors" "$dir/people-found.spid"
python3 "$here/mean.py" "$dir/half/model.safetensors" \
    "$dir/avatar/model.safetensors" "$dir/refiner/model.safetensors" refine.
join model.safetensors avatar half motion-acts shape light sure matte-photos rest
