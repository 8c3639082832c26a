#!/bin/sh
# Data-parallel training under Slurm: sbatch examples/slurm-train.sh
#SBATCH --job-name=spid-train
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=16
#SBATCH --time=48:00:00
#SBATCH --signal=B:TERM@300
# The run goes on from its checkpoint when the job is submitted again.
set -eu
config=${CONFIG:-examples/config/small-motion.json}
trap 'kill -TERM $pid; wait $pid' TERM
mpirun -n "${SLURM_NTASKS:-2}" spid-train -q -j "${SLURM_CPUS_PER_TASK:-16}" -c "$config" \
    -o "${OUT:-run/motion}" "${DATA:-data/people}" &
pid=$!
wait $pid
