#!/usr/bin/env bash
# interrupt.sh CFP_SYNTHETIC CFP_SLAM CFP_SLAM_REPORT FOLDER: Ctrl-C at any moment. What was finished stays as it is, what was
# not is no run, --resume does the rest, and tables are whole or not there.
set -euo pipefail
synthetic=$1 slam=$2 report=$3 folder=$4
fail() { echo "interrupt.sh: $*" >&2; exit 1; }
rm -rf "$folder"
mkdir -p "$folder/out"
cd "$folder"
"$synthetic" recording --width 192 --frames 20 --threads 2 >/dev/null
run() { timeout --foreground -s INT "$1" "$slam" run recording --detector none --variant plain,cfp --seeds 3 --threads 1 --out out --resume >log 2>&1; }
finished() { find out -name run.txt -printf '%p %T@\n' 2>/dev/null | sort; }

seconds=0.3 interrupted=0 before=
until run "$seconds"; do
  interrupted=$((interrupted + 1))
  ((interrupted < 40)) || fail "no end after $interrupted interruptions: $(cat log)"
  now=$(finished)
  [[ -z $(comm -23 <(echo -n "$before") <(echo -n "$now")) ]] || fail "a finished run was run again"
  [[ -z $(find out -name '*.part') ]] || rm -f $(find out -name '*.part')
  if [[ -n $now ]]; then "$report" tables out >/dev/null || fail "no tables of the finished runs"; fi
  before=$now
  seconds=$(awk "BEGIN { print $seconds * 1.3 }")
done
((interrupted > 0)) || fail "the machine is too fast for this test"
[[ $(finished | wc -l) == 6 ]] || fail "not all runs are there"
[[ -z $(comm -23 <(echo -n "$before") <(finished)) ]] || fail "a finished run was run again"

"$report" tables out >/dev/null
whole=$(cksum <out/tables.md) page=$(cksum <out/tables.html)
for seconds in 0.005 0.01 0.02 0.04 0.08 0.16; do
  rm -f out/tables.md out/tables.html
  timeout --foreground -s INT $seconds "$report" tables out >/dev/null 2>&1 || true
  [[ ! -e out/tables.md || $(cksum <out/tables.md) == "$whole" ]] || fail "half of tables.md"
  [[ ! -e out/tables.html || $(cksum <out/tables.html) == "$page" ]] || fail "half of tables.html"
done
echo "$interrupted interruptions, 6 runs"
