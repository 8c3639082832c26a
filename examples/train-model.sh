#!/bin/sh
# train-model.sh [DIR]: the shipped model from a seed, start to end.  What
# `make model` runs.  Everything lands in DIR (default build/train; 9 GB); a
# run that was stopped goes on where it was.  SEED, PEOPLE and STEPS (of every
# stage, for a trial) change the size.
set -eu

here=$(dirname "$0")
dir=${1:-build/train}
seed=${SEED:-1}
people=${PEOPLE:-4000}
mkdir -p "$dir"

# People to learn from and others to be judged by: never the same seeds.  A
# second and a quarter between frames: each shows another pose.
synth() { # FILE PEOPLE FRAMES SIZE SEED EFFECTS
    [ -e "$dir/$1" ] || spid-synth --people "$2" --frames "$3" --size "$4" \
        --seed "$5" --effects "$6" --fps 0.8 --without mesh -o "$dir/$1"
}
synth faces.spid "$people" 4 256 "$((1000 + seed))" 1
synth faces-held.spid 24 8 256 "$((900000 + seed))" 1
synth people.spid "$((people / 10))" 6 512 "$((2000 + seed))" 0.5
synth people-held.spid 12 6 512 "$((910000 + seed))" 1

train() { # NAME DATA HELD [OPTIONS]
    name=$1 data=$2 held=$3
    shift 3
    spid-train -c "$here/config/small-$name.json" -o "$dir/$name" \
        --held "$dir/$held" ${STEPS:+--steps "$STEPS"} "$@" "$dir/$data"
}
train motion faces.spid faces-held.spid
# what finds pose and expression has features for the shape, too
train shape faces.spid faces-held.spid \
    --init "$dir/motion/model.safetensors:shape.encoder.=motion.encoder."
train avatar people.spid people-held.spid
train avatar-512 people.spid people-held.spid \
    --init "$dir/avatar/model.safetensors"

spid-train -c "$here/config/small-avatar-512.json" \
    --join "$dir/model.safetensors" "$dir/avatar-512/model.safetensors" \
    "$dir/shape/model.safetensors" "$dir/motion/model.safetensors"
