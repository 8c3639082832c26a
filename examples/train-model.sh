#!/bin/sh
# train-model.sh [DIR]: the shipped model from a seed, start to end.  What
# `make model` runs.  Everything lands in DIR (default build/train); a run that
# was stopped goes on where it was.  SEED, PEOPLE and STEPS_* change the size;
# the defaults are those of the model in examples/model.
set -eu

here=$(dirname "$0")
dir=${1:-build/train}
seed=${SEED:-1}
people=${PEOPLE:-1500}
mkdir -p "$dir"

# People to learn from and others to be judged by: never the same seeds.
synth() { # FILE PEOPLE FRAMES SIZE SEED
    [ -e "$dir/$1" ] || spid-synth --people "$2" --frames "$3" --size "$4" \
        --seed "$5" --without mesh -o "$dir/$1"
}
synth faces.spid "$people" 20 256 "$((1000 + seed))"
synth faces-held.spid 24 12 256 "$((900000 + seed))"
synth people.spid "$((people / 3))" 8 512 "$((2000 + seed))"
synth people-held.spid 12 6 512 "$((910000 + seed))"

train() { # STAGE DATA HELD [OPTIONS]
    stage=$1 data=$2 held=$3
    shift 3
    spid-train -c "$here/config/small-$stage.json" -o "$dir/$stage" \
        --held "$dir/$held" "$@" "$dir/$data"
}
train shape faces.spid faces-held.spid
train motion faces.spid faces-held.spid
train avatar people.spid people-held.spid

spid-train -c "$here/config/small-avatar.json" --join "$dir/model.safetensors" \
    "$dir/avatar/model.safetensors" "$dir/shape/model.safetensors" \
    "$dir/motion/model.safetensors"
