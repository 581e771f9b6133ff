#!/usr/bin/env python3
"""What it costs to include each public header and call nothing, as a ratio to Eigen/Core alone, and what a host's unit costs that
calls both stages: with their engines in it, and with `extern template` that leaves them to another unit.

include_cost.py OUTPUT_JSON [--repetitions N] [--only TEXT]

User seconds of the compiler (CXX, default g++) at -O2, median over N rounds in which all headers take turns; and the functions
that the object holds, which should be none for a header. The goals: at most 3 for each header and the host, at most 6 for cfp.hpp.
"""
import argparse
import json
import os
import pathlib
import shlex
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
REFERENCE, DOOR = "Eigen/Core", "cfp/cfp.hpp"
HOST = """#include "cfp/frame/static_probability.hpp"
using Probability = cfp::StaticProbability<cfp::PinholeCamera<float>>;
extern template class cfp::StaticProbability<cfp::PinholeCamera<float>>;
float weight(Probability& p, const cfp::Frame<float>& frame, const cfp::PoseEstimate& pose, const std::vector<int>& match) {
  return p.coarse(frame).weight[0] + p.fine(pose, match).weight[0];
}
"""
UNITS = {"a host's unit, extern template": HOST, "a host's unit, engines in it": HOST.replace("extern template", "template")}


def eigen_flags():
    try:
        return subprocess.run(["pkg-config", "--cflags", "eigen3"], capture_output=True, text=True, check=True).stdout.split()
    except (OSError, subprocess.CalledProcessError):
        return ["-I/usr/include/eigen3"]


def compile_alone(header, folder, command):
    """User seconds and the number of functions in the object."""
    source, target = folder / "alone.cpp", folder / "alone.o"
    source.write_text(UNITS.get(header, f"#include <{header}>\n"))
    process = subprocess.Popen([*command, "-c", str(source), "-o", str(target)])
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{header} does not compile alone")
    symbols = subprocess.run(["nm", "--defined-only", str(target)], capture_output=True, text=True, check=True).stdout
    return usage.ru_utime, sum(line.split()[1] in "tTwWuU" for line in symbols.splitlines())


def measure(headers, repetitions, command):
    seconds, functions = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        compile_alone(REFERENCE, pathlib.Path(folder), command)  # fills the file cache
        for _ in range(repetitions):
            # The reference comes back every few headers: all ratios rest on it.
            turns = [name for i, header in enumerate(headers) for name in ([REFERENCE, header] if i % 8 == 0 else [header])]
            for header in turns:
                time, functions[header] = compile_alone(header, pathlib.Path(folder), command)
                seconds.setdefault(header, []).append(time)
    medians = {header: statistics.median(times) for header, times in seconds.items()}
    return [{"header": header, "seconds": medians[header], "ratio": medians[header] / medians[REFERENCE], "functions": functions[header],
             "goal": 6 if header == DOOR else 3} for header in [REFERENCE, *headers]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--only", default="", help="headers whose name contains this text")
    arguments = parser.parse_args()

    # interop/ costs what the other library's headers cost.
    names = sorted(str(path.relative_to(ROOT / "include")) for path in (ROOT / "include/cfp").rglob("*.hpp") if "interop" not in path.parts)
    command = [*shlex.split(os.environ.get("CXX", "g++")), "-std=c++17", "-O2", f"-I{ROOT / 'include'}", *eigen_flags()]
    rows = measure([name for name in [*names, *UNITS] if arguments.only in name], arguments.repetitions, command)

    for row in sorted(rows, key=lambda row: -row["ratio"]):
        mark = f"  above {row['goal']}x" if row["ratio"] > row["goal"] else ""
        mark += "  emits code" if row["functions"] and row["header"] not in UNITS else ""
        print(f"{row['header']:55} {row['seconds']:6.2f} s {row['ratio']:6.2f}x{mark}", flush=True)
    pathlib.Path(arguments.output).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
