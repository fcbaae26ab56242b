#!/bin/sh
# Every figure of README.md: sh run.sh [FOLDER]. Needs `hysteron` on the path; about two minutes.
set -e
out=${1:-is-rate-dependence-a-delay}
mkdir -p "$out" && cd "$out"
sines="--excitation sine:hz=10,periods=3 --excitation sine:hz=100,periods=5 --excitation sine:hz=500,periods=10"
judged="--validate sine:hz=200,periods=6 --validate complex-harmonic:hz=100,periods=5"
inside="--excitation decaying-triangle:high_v=26,centre_v=13"
wide="--excitation multisine:low_hz=20,high_hz=4000,period_s=0.1,periods=3,bias_v=13,peak_v=4"

hysteron paper -o paper.html | tee paper.txt
for stage in paper-rate paper-delay; do
  echo "=== $stage, the paper's records"
  hysteron simulate --stage $stage --seed 1 --overwrite $sines $judged -o $stage
  hysteron fit $stage --model mrpi -o $stage-mrpi.toml
  hysteron compare $stage $stage-mrpi.toml
  hysteron fit $stage --model mpi -o $stage-mpi.toml
  hysteron diagnose $stage $stage-mpi.toml --verbose -o $stage-next.csv
  for effect in delay first-order-lag rate-dependence; do
    hysteron add $effect $stage $stage-mpi.toml -o $stage-$effect.toml
  done
  echo "=== $stage, with minor loops and a multisine"
  hysteron simulate --stage $stage --seed 1 --overwrite $sines $inside $wide $judged -o $stage-more
  hysteron fit $stage-more --model mpi -o $stage-more-mpi.toml
  hysteron diagnose $stage-more $stage-more-mpi.toml --verbose
done
