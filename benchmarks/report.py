#!/usr/bin/env python3
"""Turns the raw output of benchmarks/run into a page to read (RESULTS.md), all rows with their spread (tables.md) and the same as data
(results.json): report.py RAW_FOLDER OUTPUT_FOLDER [--seconds N]."""
import argparse
import datetime
import json
import pathlib
import re
import statistics

BUILDS = ("base", "native")
BOXES, UNIFORM = "uniform:0", "uniform:1"
SCENES = [(n, outliers) for n in (300, 1000) for outliers in (10, 30)]

# (module, workload, ours, peer's name, the peer's row, least ratio peer/cfp for base and native).
WORKLOADS = [
    *[("static_probability", f"formulas of the second stage, {n} matches, {t}", f"stage_two_cfp<{t}>/{n}", "scalar C++ with a sort", f"stage_two_scalar_sort<>/{n}", 1, 1)
      for t, n in (("float", 1000), ("float", 10000), ("double", 1000))],
    *[("static_probability", f"object score, 500 pairs, {t}", f"object_score_cfp<{t}, cfp::ObjectScore::density>/500", "Boost.Math", "object_score_boost/500", 1, 1)
      for t in ("float", "double")],
    *[("clustering", f"DBSCAN, n = {n}", f"cfp_dbscan<float>/{n}", peer, f"{row}/{n}", 1, 1)
      for n in (200, 1000, 5000) for peer, row in (("naive O(n²)", "naive"), ("nanoflann", "nanoflann_dbscan"), ("scikit-learn", "sklearn"))],
    *[("box_tracker", "box predicted and updated", "cfp_split<double>", peer, row, 1, 1)
      for peer, row in (("cv::KalmanFilter", "cv_kalman_8x4"), ("dlib", "dlib_kalman_8x4"), ("dense EKF", "cfp_dense_ekf"))],
    *[("assignment", f"assignment, {n} x {n}, {kind}", f"cfp_most_pairs/rows:{n}/cols:{n}/{a}", peer, f"{row}/rows:{n}/cols:{n}/{a}", 1, 1)
      for n in (5, 10, 50, 200) for a, kind in ((BOXES, "boxes"), (UNIFORM, "uniform")) for peer, row in (("dlib", "dlib_max_cost"), ("scipy", "scipy"))],
    *[("math", f"chi-squared {what}, k = {k}", f"BM_chi_squared_{row}_cfp{scalar}/{k}", "Boost.Math", f"BM_chi_squared_{row}_boost/{k}", 1, 1)
      for what, row, scalar, k in (("tail", "survival", "<double>", 1), ("tail", "survival", "<double>", 2), ("tail", "survival", "<double>", 3), ("density", "density", "", 2))],
    *[("fundamental", f"F, {n} pairs, {out} % outliers", f"{n} {out}%: cfp", peer, f"{n} {out}%: {peer}", *least)
      for n in (500, 1000) for out in (20, 40) for peer, least in (("cv USAC_MAGSAC", (1.7, 2.7)), ("cv FM_RANSAC 0.1 px", (1, 1)))],
    *[("pnp_ransac", f"pose without a start, {n} matches, {out} % outliers", f"{n} {out}%: cfp, weighted sampling", peer, f"{n} {out}%: {peer}", 1, 1)
      for n in (300, 1000) for out in (30, 60) for peer in ("cv P3P",)],
    *[("pose_refinement", f"pose, N = {n}, {out} % outliers, {t}", f"pixel only, N = {n}, {out} % outliers: cfp {t}, default", "Ceres, ORB-SLAM2's schedule",
       f"pixel only, N = {n}, {out} % outliers: Ceres, ORB-SLAM2 schedule, QR", *least) for n, out in SCENES for t, least in (("double", (20, 60)), ("float", (30, 110)))],
    *[("pose_refinement", f"the same schedule, N = {n}, {out} % outliers, double", f"pixel only, N = {n}, {out} % outliers: cfp double, ORB-SLAM2 schedule",
       "Ceres, ORB-SLAM2's schedule", f"pixel only, N = {n}, {out} % outliers: Ceres, ORB-SLAM2 schedule, QR", 1, 1) for n, out in SCENES],
    *[("bundle_adjustment", f"bundle adjustment, {p} poses, {x} points, one thread", f"Local bundle adjustment, {p} poses (2 fixed) x {x}: cfp, one thread", "Ceres DENSE_SCHUR",
       f"Local bundle adjustment, {p} poses (2 fixed) x {x}: Ceres DENSE_SCHUR, threads: 1", 6.5, 6.5) for p, x in ((10, 1000), (20, 3000))],
]

# What runs once per frame: (module, row, what, most microseconds for base and native).
FRAME = [
    ("frame", "frame<float, Stages::both, Given::fundamental>", "both stages, F given, float", 170, 140),
    ("frame", "frame<double, Stages::both, Given::fundamental>", "both stages, F given, double", None, None),
    ("frame", "frame<float, Stages::both, Given::depths>", "both stages, motion from the flow's depths, float", 500, 500),
    ("frame", "frame<float, Stages::both, Given::keypoint_depths>", "the same by the depths of the keypoints next to it, float", None, None),
    ("frame", "frame<float, Stages::both, Given::motion>", "both stages, a host's motion, no depths, float", None, None),
    ("frame", "frame<float, Stages::both, Given::nothing>", "both stages, F by RANSAC, float", 1500, 1500),
    ("frame", "frame<double, Stages::both, Given::nothing>", "both stages, F by RANSAC, double", None, None),
    ("box_tracker", "cfp_frame<double>/5", "box tracker, 5 boxes", 2, 2),
    ("box_tracker", "cfp_frame<double>/20", "box tracker, 20 boxes", 10, 10),
    ("clustering", "foreground/window/200", "foreground of a box of 200 keypoints", None, None),
]

# The average times of the paper's Table V (CFP-SLAM, an i7 with an RTX 3060) in milliseconds; what of ours does that work, how often.
PAPER = [
    ("EKF: missed-detection compensation and association of boxes", 0.07, 1, "box_tracker", "cfp_frame<double>/5", "5 boxes"),
    ("OSP: static probability of objects", 17.93, 1, "frame", "frame<float, Stages::coarse, Given::nothing>",
     "500 pairs, 3 boxes, F's RANSAC, foreground included; corners and optical flow, most of the paper's time, excluded"),
    ("DBSCAN: clustering of the keypoints in boxes", 1.76, 3, "clustering", "foreground/dbscan/200", "3 boxes of 200 keypoints, adaptive eps included"),
    ("KSP: static probability of keypoints", 3.66, 1, "frame", "frame<float, Stages::fine, Given::fundamental>", "1000 keypoints, map points and weights included"),
    ("two pose optimisations", "part of Tracking, 42.7", 2, "pose_refinement", "pixel only, N = 1000, 10 % outliers: cfp double, default", "1000 points, 10 % outliers"),
]

# The tables that some programs print themselves: nanoseconds of their unit, column of the time, column of the quality and its name.
PRINTED = {"fundamental": (1e3, 2, 0, "median error, px"), "pnp_ransac": (1e3, 3, 0, "median error, mm"),
           "pose_refinement": (1e3, 0, 1, "centre, mm"), "bundle_adjustment": (1e6, 0, 4, "position, mm")}
OF_GOOGLE_BENCHMARK = {"name", "family_index", "per_family_instance_index", "run_name", "run_type", "repetitions", "repetition_index", "threads",
                       "iterations", "real_time", "cpu_time", "time_unit", "items_per_second"}


class Row:
    """One measured thing: ns[build][run], and numbers that tell its quality."""

    def __init__(self):
        self.ns = {build: {} for build in BUILDS}
        self.quality = {}

    def median(self, build):
        return statistics.median(self.ns[build].values()) if self.ns[build] else None


def printed_rows(text):
    """(name, numbers) of a printed table; the name begins with the table's title, or with number of data and share where a row has them."""
    title, before = "", ""
    for line in text.splitlines():
        previous, before = before, line
        share = re.match(r"(.*?)\s+(\d+)\s+(\d+%)\s+(?:good\s+)?([-\d.].*)", line)
        if share:
            yield f"{share[2]} {share[3]}: {share[1].strip()}", numbers_of(share[4])
            continue
        words = re.split(r"\s{2,}", re.sub(r",\s+", ", ", line.strip()))
        if len(words) > 1 and (numbers := numbers_of(" ".join(words[1:]))):
            yield f"{title}: {words[0]}", numbers
        elif not previous.strip() and line:
            title = re.split(r";| points x", line)[0]


def numbers_of(text):
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]


def read(raw):
    """rows[module, name], the versions of what Python measured, and the machine as Google Benchmark sees it."""
    rows, versions, machine = {}, {}, {}

    def row(module, name):
        return rows.setdefault((module, name), Row())

    for path in sorted(raw.glob("[0-9]*-*")):
        repetition, build, module = path.stem.split("-", 2)
        if build == "python" and path.suffix == ".json":
            data = json.loads(path.read_text())
            versions.update(data["versions"])
            for name, ns in data["times_ns"].items():
                for each in BUILDS:
                    row({"sklearn_dbscan": "clustering", "scipy_assignment": "assignment"}[module], name).ns[each][repetition] = ns
        elif path.suffix == ".json":
            data = json.loads(path.read_text())
            machine = data["context"]
            for entry in data["benchmarks"]:
                if entry.get("run_type", "iteration") == "iteration" and not entry.get("error_occurred"):
                    this = row(module, entry.get("run_name", entry["name"]))
                    this.ns[build][f"{repetition}.{entry.get('repetition_index', 0)}"] = entry["cpu_time"] * {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}[entry["time_unit"]]
                    this.quality.update({k: v for k, v in entry.items() if k not in OF_GOOGLE_BENCHMARK})
        elif path.suffix == ".txt" and module in PRINTED:
            unit, time, quality, what = PRINTED[module]
            for name, numbers in printed_rows(path.read_text()):
                if len(numbers) > max(time, quality):
                    row(module, name).ns[build][repetition] = unit * numbers[time]
                    row(module, name).quality[what] = numbers[quality]
    return rows, versions, machine


def ratios(ours, peer, build):
    """Peer over ours for the runs that both have; a peer measured once per repetition serves all of its runs."""
    theirs = peer.ns[build]
    pairs = [(time, theirs.get(run, theirs.get(run.split(".")[0]))) for run, time in ours.ns[build].items()]
    return [b / a for a, b in pairs if a > 0 and b is not None]


def number(x):
    return f"{x:.3g}" if abs(x) < 1000 else f"{x:.0f}"


def duration(ns):
    if ns is None:
        return ""
    unit, size = next(((u, s) for u, s in (("s", 1e9), ("ms", 1e6), ("µs", 1e3)) if ns >= s), ("ns", 1))
    return f"{number(ns / size)} {unit}"


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def judged(value, goal, met):
    return number(value) if met or goal is None else f"**{number(value)}**"


def peer_table(rows):
    lines = []
    for module, what, ours, peer, theirs, *goals in WORKLOADS:
        ours, theirs = rows.get((module, ours)), rows.get((module, theirs))
        if not ours or not theirs:
            continue
        cells = [statistics.median(values) if (values := ratios(ours, theirs, build)) else None for build in BUILDS]
        cells = [judged(value, goal, value >= goal) if value else "" for value, goal in zip(cells, goals)]
        common = [k for k in ours.quality if k in theirs.quality and not k.endswith("_us")][:1]
        quality = [f"{k}: {number(ours.quality[k])}; {number(theirs.quality[k])}" for k in common]
        lines.append([what, peer, *(duration(ours.median(build)) for build in BUILDS), *cells, "; ".join(f"{g:g}" for g in dict.fromkeys(goals)), *(quality or [""])])
    return table(["workload", "peer", "cfp base", "cfp native", "ratio base", "ratio native", "goal", "quality: cfp; peer"], lines)


def frame_table(rows):
    lines = []
    for module, name, what, *goals in FRAME:
        if row := rows.get((module, name)):
            cells = [judged(ns / 1e3, goal, goal is None or ns <= 1e3 * goal) if (ns := row.median(build)) else "" for build, goal in zip(BUILDS, goals)]
            calls = [number(row.quality[k]) if k in row.quality else "" for k in ("p50_us", "p95_us", "p99_us")]
            lines.append([what, *cells, "; ".join(str(goal) for goal in dict.fromkeys(goals) if goal), *calls])
    return table(["µs", "base", "native", "goal", "native, 50 %", "95 %", "99 %"], lines)


def paper_table(rows):
    lines = []
    for what, paper_ms, times, module, name, remark in PAPER:
        if row := rows.get((module, name)):
            lines.append([what, paper_ms, *(f"{times * row.median(build) / 1e6:.4f}" if row.median(build) else "" for build in BUILDS), remark])
    return table(["module", "paper, ms", "cfp base, ms", "cfp native, ms", "what is measured"], lines)


def include_table(entries):
    hosts = [e for e in entries if not e["header"].endswith(".hpp") and e["header"] != "Eigen/Core"]
    dearest = sorted((e for e in entries if e not in hosts), key=lambda e: -e["ratio"])[:6]
    return table(["a unit", "s", "ratio to Eigen/Core", "goal"], [[f"`{e['header']}`", f"{e['seconds']:.2f}", judged(e["ratio"], e["goal"], e["ratio"] <= e["goal"]), e["goal"]] for e in [*hosts, *dearest]])


def page(rows, versions, machine, environment, include, seconds, commit):
    caches = ", ".join(f"L{c['level']} {c['type'].lower()} {c['size'] // 1024} KiB" for c in machine.get("caches", []))
    versions = {k: v for k, v in environment["base"].items() if k not in ("compiler", "flags", "instruction set")} | versions
    parts = [
        "# Results\n",
        f"Written by `benchmarks/run` on {datetime.date.today()}{commit and f' at commit {commit}'}, {seconds / 60:.0f} minutes; do not edit. All rows with their spread, quality and percentiles: `build/bench-results` after a run.\n",
        table(["", ""], [("processor", f"{processor()}, {machine.get('num_cpus', '')} cores" + (f"; {caches}" if caches else "")), ("compiler", environment["base"]["compiler"]),
                         *[(b, f"`{environment[b]['flags'].strip()}`: {environment[b]['instruction set']}") for b in BUILDS], ("versions", ", ".join(f"{k} {v}" for k, v in versions.items()))]),
        "Times are processor time of one thread, medians over all runs. Both builds take turns, module by module, several times; within a process the benchmarks are interleaved, "
        "and inputs rotate. **Bold: misses its goal.**\n",
        "## A frame\n", frame_table(rows),
        "## Beside other libraries\n",
        "A ratio is *peer over cfp* of neighbouring runs of one process (scikit-learn and scipy: of one turn), above 1 where cfp is faster; two goals are base and native.\n", peer_table(rows),
        "## Beside the paper's timing table\n", "Table V is from another machine (an i7 with an RTX 3060); its Tracking, 42.7 ms, is all of a frame in the main thread. YOLO (12.44 ms) is outside of cfp.\n", paper_table(rows)]
    if include:
        parts += ["## Including a header\n", f"Nothing called but in a host's units, `-O2`; the dearest of {len(include)} units.\n", include_table(include)]
    parts += ["## Limits\n", "* One machine, one compiler; another process on it moves single ratios by a tenth.\n"
              "* Peers that are binaries (OpenCV, Ceres) are the distribution's: baseline code with what they choose at run time, in both builds. Header-only peers are compiled with the build's flags.\n"
              "* Growth with the size of the data can be read from rows of several sizes in `tables.md`.\n"]
    return "\n".join(parts).rstrip("\n") + "\n"


def processor():
    info = pathlib.Path("/proc/cpuinfo")
    return next((line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")), "") if info.exists() else ""


def all_rows(rows):
    def spread(times):
        return f"{duration(statistics.median(times))} ({duration(min(times))} to {duration(max(times))})" if times else ""

    return "# All rows: median (least to most)\n\n" + table(
        ["module", "row", *BUILDS, "numbers of the last run"],
        [[module, name, *(spread(row.ns[b].values()) for b in BUILDS), ", ".join(f"{k} {number(v)}" for k, v in row.quality.items())] for (module, name), row in sorted(rows.items())])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("raw", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=0)
    arguments = parser.parse_args()
    rows, versions, machine = read(arguments.raw)
    include_file = arguments.raw / "include.json"
    include = json.loads(include_file.read_text()) if include_file.exists() else []
    if not rows and not include:
        raise SystemExit(f"{arguments.raw}: no output of any benchmark")
    measured = {module for module, _ in rows}
    wanted = [(w[0], name) for w in WORKLOADS for name in (w[2], w[4])] + [f[:2] for f in FRAME] + [p[3:5] for p in PAPER]
    for module, name in sorted({w for w in wanted if w[0] in measured and w not in rows}):
        print(f"not measured: {module}: {name}")
    environment = {b: json.loads((arguments.raw / f"environment-{b}.json").read_text()) for b in BUILDS}
    commit_file = arguments.raw / "commit"
    commit = commit_file.read_text().strip() if commit_file.exists() else ""
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "RESULTS.md").write_text(page(rows, versions, machine, environment, include, arguments.seconds, commit))
    (arguments.output / "tables.md").write_text(all_rows(rows))
    data = [{"module": module, "name": name, "ns": row.ns, "numbers": row.quality} for (module, name), row in sorted(rows.items())]
    (arguments.output / "results.json").write_text(json.dumps({"environment": environment, "rows": data, "include": include}, indent=1) + "\n")


if __name__ == "__main__":
    main()
