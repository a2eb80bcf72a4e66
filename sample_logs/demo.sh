#!/bin/sh
# From logs of pushes to a policy map: what a newcomer would type. Everything lands in demo/.
set -eu
cd "$(dirname "$0")/.."
mkdir -p demo

run() {
    printf '\n$ navirl %s\n' "$*"
    navirl "$@"
}

run extract sample_logs/p01.mcap sample_logs/p02.mcap sample_logs/p03.mcap -o demo/demos.json --force
run fit demo/demos.json --condition force --cycle 2 --profile sigma_p --cross-validate participant -o demo/reward.json --force
run evaluate demo/demos.json --reward demo/reward.json --all -o demo/metrics.json --force
run plot paths demo/demos.json -o demo/paths.png --force
run plot policy demo/demos.json --reward demo/reward.json --trial p03/4 --crop --overlay all --wide -o demo/policy.png --force
run plot reward demo/demos.json --reward demo/reward.json --trial p01/3 -o demo/reward.png --force
run plot properties demo/demos.json --reward demo/reward.json --all -o demo/properties.png --force
run plot profile demo/reward.json -o demo/profile.png --force
run study sample_logs/p01.mcap sample_logs/p02.mcap sample_logs/p03.mcap -o demo/study --force
python3 sample_logs/demo_summary.py demo
