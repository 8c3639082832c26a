#!/usr/bin/env bash
#SBATCH --job-name=spid
#SBATCH --array=0-99%8
#SBATCH --cpus-per-task=4
#SBATCH --mem=2G
#SBATCH --requeue
#SBATCH --open-mode=append
# sbatch slurm.sh LIST: task i of the array makes the lines i, i + N, i + 2N,
# ... of LIST (SOURCE, DRIVER, OUT with tabs between), N tasks in all.  The
# list may be longer or shorter than the array.  A clip that is killed is tried
# again (one.sh), a task whose machine died is queued again, and both leave
# what is there already; sbatch it once more for what is still missing.
set -euo pipefail
here=${SPID_EXAMPLES:-$(cd "$(dirname "$0")" && pwd)}
list=$1 bad=0 i=0
id=${SLURM_ARRAY_TASK_ID:-0} tasks=${SLURM_ARRAY_TASK_COUNT:-1}
export SPID_THREADS=${SLURM_CPUS_PER_TASK:-1}
while IFS=$'\t' read -r source driver out; do
    if (( i++ % tasks == id )); then
        "$here/one.sh" "$source" "$driver" "$out" < /dev/null || bad=1
    fi
done < "$list"
exit $bad
