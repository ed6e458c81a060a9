#!/usr/bin/env bash
# Installs Debian's Slurm for the tests on a private cluster, where it is missing and root or sudo allows it. No service is
# started: the tests start daemons of their own.
set -euo pipefail

command -v slurmctld >/dev/null && command -v slurmd >/dev/null && command -v sbatch >/dev/null && exit 0
say() { printf 'slurm-test: %s\n' "$*" >&2; }
as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi
}
if ! command -v apt-get >/dev/null; then
    say "needs slurmctld, slurmd and sbatch on the PATH (Debian: slurm-wlm)"
    exit 1
fi
say "installing Debian's slurm-wlm"
as_root apt-get update -qq
# runlevel 1: the packages' services stay off
as_root env RUNLEVEL=1 DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurm-wlm >/dev/null
