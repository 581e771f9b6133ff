#!/usr/bin/env python3
"""Turns the raw output of benchmarks/run into results.json and RESULTS.md: report.py RAW_FOLDER OUTPUT_FOLDER [--seconds N]."""
import argparse
import datetime
import glob
import json
import math
import os
import re
import statistics

BUILDS = ("base", "native")
TITLES = {
    "static_probability": "Formulas of both stages", "frame": "Both stages for a frame", "clustering": "Depth clustering", "box_tracker": "Box tracker",
    "assignment": "Assignment", "math": "Chi-squared, order statistics, logistic", "geometry": "Distances", "fundamental": "Fundamental matrix",
    "pnp_ransac": "Pose without a start", "pose_refinement": "Pose refinement", "bundle_adjustment": "Bundle adjustment"}

# Ours against a peer of the same module and process: (module, ours, peer, what for; {} stands for the arguments).
BOXES, UNIFORM = "uniform:0", "uniform:1"
SQUARES = [f"rows:{n}/cols:{n}/{kind}" for kind in (BOXES, UNIFORM) for n in (5, 10, 50, 200)]
RATIOS = (
    [("static_probability", f"stage_two_cfp<{t}>/{n}", f"stage_two_scalar_sort<>/{n}", f"stage 2, {n} matches, {t}: scalar C++ with a sort")
     for t in ("float", "double") for n in (100, 1000, 10000, 100000)]
    + [("static_probability", "stage_two_cfp<float, true>/1000", "stage_two_scalar_sort<true>/1000", "stage 2 and combination, 1000 matches, float: scalar C++ with a sort")]
    + [("static_probability", f"object_score_cfp<{t}, cfp::ObjectScore::density>/{n}", f"object_score_boost/{n}", f"object score, {n} pairs, {t}: Boost.Math")
       for t in ("float", "double") for n in (100, 500, 1000, 10000)]
    + [("clustering", f"cfp_dbscan<float>/{n}", f"naive/{n}", f"DBSCAN, n = {n}: naive O(n^2)") for n in (50, 200, 1000, 5000)]
    + [("clustering", f"cfp_dbscan<float>/{n}", f"nanoflann_dbscan/{n}", f"DBSCAN, n = {n}: nanoflann") for n in (50, 200, 1000, 5000)]
    + [("clustering", f"cfp_dbscan<float>/{n}", f"sklearn/{n}", f"DBSCAN, n = {n}: scikit-learn") for n in (50, 200, 1000, 5000)]
    + [("box_tracker", "cfp_split<double>", peer, f"box predicted and updated: {name}")
       for peer, name in (("cv_kalman_8x4", "cv::KalmanFilter"), ("dlib_kalman_8x4", "dlib"), ("cfp_dense_ekf<double>", "own dense EKF"))]
    + [("assignment", f"cfp_most_pairs/{a}", f"dlib_max_cost/{a}", f"assignment {a}: dlib") for a in SQUARES]
    + [("assignment", f"cfp_most_pairs/{a}", f"scipy/{a}", f"assignment {a}: scipy") for a in SQUARES]
    + [("math", f"BM_chi_squared_survival_cfp<double>/{k}", f"BM_chi_squared_survival_boost/{k}", f"chi-squared tail, k = {k}: Boost.Math") for k in (1, 2, 3, 10)]
    + [("math", f"BM_chi_squared_density_cfp/{k}", f"BM_chi_squared_density_boost/{k}", f"chi-squared density, k = {k}: Boost.Math") for k in (1, 2, 3, 10)]
    + [("math", f"BM_quantile<float, Method::cfp>/{n}", f"BM_quantile<float, Method::nth_element>/{n}", f"0.8 quantile of {n}: std::nth_element") for n in (100, 1000, 10000)]
    + [("math", "BM_three_quantiles<float, true>/1000", "BM_three_quantiles<float, false>/1000", "three quantiles of 1000: std::nth_element")]
    + [("math", f"BM_logistic_array<{t}>", f"BM_logistic_scalar_loop<{t}>", f"logistic of 1000, {t}: scalar loop") for t in ("float", "double")]
)

# Growth: (module, benchmark, the arguments by which it is fitted).
SWEEPS = [
    ("static_probability", "stage_two_cfp<float>/{}", (100, 1000, 10000, 100000)),
    ("static_probability", "object_score_cfp<float, cfp::ObjectScore::density>/{}", (100, 1000, 10000, 100000)),
    ("static_probability", "stage_two_scalar_sort<>/{}", (100, 1000, 10000, 100000)),
    ("clustering", "cfp_dbscan<float>/{}", (200, 1000, 5000, 50000)),
    ("clustering", "foreground/density/{}", (200, 1000, 5000)),
    ("clustering", "naive/{}", (200, 1000, 5000)),
    ("math", "BM_quantile<float, Method::cfp>/{}", (100, 300, 1000, 10000)),
    ("assignment", "cfp_most_pairs/rows:{0}/cols:{0}/uniform:0", (10, 50, 200)),
    ("assignment", "cfp_most_pairs/rows:{0}/cols:{0}/uniform:1", (10, 50, 200)),
    ("box_tracker", "cfp_frame<double>/{}", (5, 20, 50)),
]

# The tables that some programs print themselves: (module, section, ours, peer, what for). A row's first number is its time.
PNP = [(n, out) for n in (300, 1000) for out in (10, 30)]
TEXT_RATIOS = (
    [("pose_refinement", f"pixel only, N = {n}, {out} %", "cfp double, ORB-SLAM2 schedule", "Ceres, ORB-SLAM2 schedule, QR", f"pose, N = {n}, {out} % outliers, ORB-SLAM2's schedule: Ceres")
     for n, out in PNP]
    + [("pose_refinement", f"pixel only, N = {n}, {out} %", "cfp double, default", "Ceres, ORB-SLAM2 schedule, QR", f"pose, N = {n}, {out} % outliers, default: Ceres with ORB-SLAM2's schedule")
       for n, out in PNP]
    + [("bundle_adjustment", f"Local bundle adjustment, {p} poses (2 fixed) x {x}", "cfp, one thread", "Ceres DENSE_SCHUR, threads: 1", f"bundle adjustment, {p} poses, {x} points: Ceres DENSE_SCHUR")
       for p, x in ((10, 1000), (20, 3000))]
    + [("fundamental", f"{n} {out}%", "cfp", peer, f"F, {n} pairs, {out} % outliers: {peer}") for n in (500, 1000) for out in (20, 40)
       for peer in ("cv USAC_MAGSAC", "cv FM_RANSAC 0.1 px")]
)

# (what, kind, key, least or most for base and native); ratios are met from the goal up, times (ns) down from it.
GOALS = [
    ("stage 2's formulas, 1000 matches, float: ns per keypoint and constraint", "time", ("static_probability", "stage_two_cfp<float>/1000", 1 / 2000), 9, 4),
    ("the same and their combination for every keypoint: ns per keypoint and constraint", "time", ("static_probability", "stage_two_cfp<float, true>/1000", 1 / 2000), 9, 4),
    ("stage 2's formulas, 1000 matches, float, over scalar C++ with a sort", "ratio", "stage 2, 1000 matches, float: scalar C++ with a sort", 4, 12),
    ("object score, 500 pairs, F given, float, over Boost.Math's density", "ratio", "object score, 500 pairs, float: Boost.Math", 15, 80),
    ("the scores of the pairs alone (density, k = 2, double), over Boost.Math's density", "ratio", "chi-squared density, k = 2: Boost.Math", 15, 80),
    ("DBSCAN, n = 200, over naive O(n^2)", "ratio", "DBSCAN, n = 200: naive O(n^2)", 10, 10),
    ("DBSCAN, n = 1000, over naive O(n^2)", "ratio", "DBSCAN, n = 1000: naive O(n^2)", 30, 30),
    ("DBSCAN, n = 5000, over naive O(n^2)", "ratio", "DBSCAN, n = 5000: naive O(n^2)", 120, 120),
    ("DBSCAN, n = 1000, over scikit-learn", "ratio", "DBSCAN, n = 1000: scikit-learn", 90, 90),
    ("adaptive eps and foreground, n = 200: times the clustering", "multiple", ("clustering", "foreground/density/200", "cfp_dbscan<float>/200"), 2, 2),
    ("box tracker frame, 5 boxes: us", "time", ("box_tracker", "cfp_frame<double>/5", 1e-3), 2, 2),
    ("box tracker frame, 20 boxes: us", "time", ("box_tracker", "cfp_frame<double>/20", 1e-3), 10, 10),
    *[(f"assignment {n} x {n}, {kind}, over dlib", "ratio", f"assignment rows:{n}/cols:{n}/{a}: dlib", 3 if n < 200 else 1, 3 if n < 200 else 1)
      for a, kind in ((BOXES, "boxes"), (UNIFORM, "uniform")) for n in (5, 10, 50, 200)],
    *[(f"assignment {n} x {n}, {kind}, over scipy", "ratio", f"assignment rows:{n}/cols:{n}/{a}: scipy", 1.5 if n < 200 else 1, 1.5 if n < 200 else 1)
      for a, kind in ((BOXES, "boxes"), (UNIFORM, "uniform")) for n in (5, 10, 50, 200)],
    ("stage 1 and 2 for a frame, F by RANSAC: us", "time", ("frame", "frame<float, Stages::both, false>", 1e-3), 1500, 1500),
    ("stage 1 and 2 for a frame, F given: us", "time", ("frame", "frame<float, Stages::both, true>", 1e-3), 350, 350),
    *[(f"pose, N = {n}, {out} %, ORB-SLAM2's schedule, over Ceres", "ratio", f"pose, N = {n}, {out} % outliers, ORB-SLAM2's schedule: Ceres", 7, 25) for n, out in PNP],
    *[(f"pose, N = {n}, {out} %, default, over Ceres", "ratio", f"pose, N = {n}, {out} % outliers, default: Ceres with ORB-SLAM2's schedule", 20, 80) for n, out in PNP],
    *[(f"bundle adjustment {p} x {x}, one thread, over Ceres", "ratio", f"bundle adjustment, {p} poses, {x} points: Ceres DENSE_SCHUR", 6, 6) for p, x in ((10, 1000), (20, 3000))],
    *[(f"F, {n} pairs, {out} %, over {peer}", "ratio", f"F, {n} pairs, {out} % outliers: {peer}", least, least) for n in (500, 1000) for out in (20, 40)
      for peer, least in (("cv USAC_MAGSAC", 1), ("cv FM_RANSAC 0.1 px", 10))],
]

# The average times of the paper's Table V (CFP-SLAM, an i7 with an RTX 3060) in milliseconds, and what of ours does that work.
PAPER = [
    ("EKF: missed-detection compensation and association of boxes", 0.07, [(1, "box_tracker", "cfp_frame<double>/5")], "5 boxes"),
    ("OSP: static probability of objects", 17.93, [(1, "frame", "frame<float, Stages::first, false>")],
     "500 pairs, 3 boxes, F's RANSAC, foreground included; corners and optical flow, most of the paper's time, excluded"),
    ("DBSCAN: clustering of the keypoints in boxes", 1.76, [(3, "clustering", "foreground/density/200")], "3 boxes of 200 keypoints, adaptive eps included"),
    ("KSP: static probability of keypoints", 3.66, [(1, "frame", "frame<float, Stages::second, true>")], "1000 keypoints, map points and weights included"),
    ("two pose optimisations", "part of Tracking, 42.7", [(2, "pose_refinement", "cfp double, default", "pixel only, N = 1000, 10 %")], "1000 points, 10 % outliers"),
]


def read(raw):
    """times[module, name][build][run] in ns, counters[module, name][build], texts[module][build], contexts, python."""
    times, counters, texts, context, versions = {}, {}, {}, {}, {}
    for path in sorted(glob.glob(os.path.join(raw, "*"))):
        repetition, _, rest = os.path.basename(path).partition("-")
        build, _, module = rest.partition("-")
        module, extension = os.path.splitext(module)
        if repetition == "environment":
            continue
        if build == "python" and extension == ".json":
            data = json.load(open(path))
            versions.update(data["versions"])
            for name, time in data["times_ns"].items():
                for b in BUILDS:
                    times.setdefault((module.split("_")[1].replace("dbscan", "clustering"), name), {}).setdefault(b, {})[repetition] = time
        elif extension == ".json":
            data = json.load(open(path))
            context = data["context"]
            for row in data["benchmarks"]:
                if row.get("run_type", "iteration") != "iteration" or row.get("error_occurred"):
                    continue
                scale = {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}[row["time_unit"]]
                key = (module, row.get("run_name", row["name"]))
                times.setdefault(key, {}).setdefault(build, {})[f"{repetition}.{row.get('repetition_index', 0)}"] = scale * row["cpu_time"]
                known = ("name", "family_index", "per_family_instance_index", "run_name", "run_type", "repetitions", "repetition_index", "threads",
                         "iterations", "real_time", "cpu_time", "time_unit", "items_per_second")
                counters.setdefault(key, {}).setdefault(build, {}).update({k: v for k, v in row.items() if k not in known})
        elif extension == ".txt" and not os.path.exists(path[:-4] + ".json"):
            texts.setdefault(module, {}).setdefault(build, {})[repetition] = open(path).read().strip("\n")
    return times, counters, texts, context, versions


def table_rows(text):
    """(section, name) -> numbers of a printed table. Rows that start with the number of data and a share get them as section."""
    rows, section, before = {}, "", ""
    for line in text.splitlines():
        previous, before = before, line
        words = re.split(r"\s{2,}", line.strip())
        numbers = [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", " ".join(words[1:]))]
        if len(words) < 2 or not numbers:  # a title after an empty line, then the names of the columns
            section = section if previous.strip() else line or section
            continue
        share = re.match(r"(.*?)\s+(\d+)\s+(\d+)%", line)
        if share:
            rows[f"{share[2]} {share[3]}%", share[1].strip()] = numbers[2:]
        else:
            rows[section, words[0]] = numbers
    return rows


def text_times(texts, module, section, name):
    """{build: {repetition: time}} of a row; the fundamental matrix prints two errors before its time."""
    column = 2 if module == "fundamental" else 0
    out = {}
    for build, by_repetition in texts.get(module, {}).items():
        for repetition, text in by_repetition.items():
            for (where, row), numbers in table_rows(text).items():
                if where.startswith(section) and row == name and len(numbers) > column:
                    out.setdefault(build, {})[repetition] = numbers[column]
    return out


def spread(values):
    """Median, least and most."""
    values = list(values)
    return {"median": statistics.median(values), "low": min(values), "high": max(values), "runs": len(values)}


def ratios_of(ours, peer):
    """{build: spread of peer / ours over the runs that both have}; a peer measured once per repetition serves all runs of it."""
    out = {}
    for build in BUILDS:
        mine, theirs = ours.get(build, {}), peer.get(build, {})
        pairs = [(mine[r], theirs.get(r, theirs.get(r.split(".")[0]))) for r in mine]
        values = [b / a for a, b in pairs if b is not None and a > 0]
        if values:
            out[build] = spread(values)
    return out


def exponent(points):
    """Slope of log time over log n."""
    xs, ys = [math.log(n) for n, _ in points], [math.log(t) for _, t in points]
    mx, my = statistics.mean(xs), statistics.mean(ys)
    return sum((x - mx) * (y - my) for x, y in zip(xs, ys)) / sum((x - mx) ** 2 for x in xs)


def analyse(raw, seconds):
    times, counters, texts, context, versions = read(raw)
    environment = {b: json.load(open(os.path.join(raw, f"environment-{b}.json"))) for b in BUILDS}
    rows = [{"module": m, "name": n, "ns": {b: spread(by_run.values()) for b, by_run in by_build.items()}, "counters": counters.get((m, n), {})}
            for (m, n), by_build in sorted(times.items())]
    ratios = {}
    for module, ours, peer, what in RATIOS:
        found = ratios_of(times.get((module, ours), {}), times.get((module, peer), {}))
        if found:
            ratios[what] = {"module": module, **found}
    for module, section, ours, peer, what in TEXT_RATIOS:
        found = ratios_of(text_times(texts, module, section, ours), text_times(texts, module, section, peer))
        if found:
            ratios[what] = {"module": module, **found}
    goals = []
    for what, kind, key, *limits in GOALS:
        measured = {}
        for build in BUILDS:
            if kind == "ratio":
                value = ratios.get(key, {}).get(build, {}).get("median")
            elif kind == "time":
                values = times.get(key[:2], {}).get(build, {}).values()
                value = statistics.median(values) * key[2] if values else None
            else:
                value = ratios_of(times.get((key[0], key[2]), {}), times.get((key[0], key[1]), {})).get(build, {}).get("median")
            if value is not None:
                goal = limits[BUILDS.index(build)]
                measured[build] = {"value": value, "goal": goal, "met": value >= goal if kind == "ratio" else value <= goal}
        if measured:
            goals.append({"goal": what, "kind": kind, **measured})
    growth = []
    for module, pattern, sizes in SWEEPS:
        entry = {"module": module, "name": pattern, "sizes": sizes}
        for build in BUILDS:
            points = [(n, times.get((module, pattern.format(n)), {}).get(build, {}).values()) for n in sizes]
            points = [(n, statistics.median(v)) for n, v in points if v]
            if len(points) > 2:
                entry[build] = exponent(points)
        if any(b in entry for b in BUILDS):
            growth.append(entry)
    paper = []
    for name, milliseconds, parts, remark in PAPER:
        entry = {"module": name, "paper_ms": milliseconds, "remark": remark}
        for build in BUILDS:
            values = []
            for factor, m, n, *section in parts:  # a printed table is in microseconds
                found = text_times(texts, m, section[0], n) if section else times.get((m, n), {})
                values.append((factor * (1e3 if section else 1), found.get(build, {}).values()))
            if all(v for _, v in values):
                entry[build + "_ms"] = sum(f * statistics.median(v) for f, v in values) / 1e6
        paper.append(entry)
    cpu = next((line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "") if os.path.exists("/proc/cpuinfo") else ""
    return {"date": datetime.date.today().isoformat(), "cpu": cpu, "context": context, "environment": environment, "versions": versions, "seconds": seconds,
            "goals": goals, "ratios": ratios, "growth": growth, "paper_table_v": paper, "rows": rows, "texts": texts}


def number(x):
    return f"{x:.3g}" if abs(x) < 1000 else f"{x:.0f}"


def duration(ns):
    for unit, size in (("s", 1e9), ("ms", 1e6), ("us", 1e3)):
        if ns >= size:
            return f"{number(ns / size)} {unit}"
    return f"{number(ns)} ns"


def spread_text(s, form):
    return f"{form(s['median'])} ({form(s['low'])} to {form(s['high'])})" if s else ""


def markdown(r):
    out = []
    line = out.append

    def table(head, rows):
        line("| " + " | ".join(head) + " |")
        line("|" + "---|" * len(head))
        for row in rows:
            line("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |")
        line("")

    caches = ", ".join(f"L{c['level']} {c['type'].lower()} {c['size'] // 1024} KiB" for c in r["context"].get("caches", []))
    versions = {**{k: v for k, v in r["environment"]["base"].items() if k not in ("compiler", "flags", "instruction set")}, **r["versions"]}
    line("# Results\n")
    line(f"Written by `benchmarks/run` on {r['date']}, {r['seconds'] / 60:.1f} minutes; the same figures and more in `results.json`. Do not edit.\n")
    table(("", ""), [("processor", r["cpu"]), ("cores, caches", f"{r['context'].get('num_cpus', '')}; {caches}"), ("compiler", r["environment"]["base"]["compiler"]),
                     *[(b, f"`{r['environment'][b]['flags'].strip()}`: {r['environment'][b]['instruction set']}") for b in BUILDS],
                     ("versions", ", ".join(f"{k} {v}" for k, v in versions.items()))])
    line("Times are processor time of one thread: median over all runs, in brackets the least and the most. Both builds take turns, module by module, several times; "
         "within a process the benchmarks are interleaved in random order, and inputs rotate. A ratio is *peer over cfp* of neighbouring runs of the same process and "
         "build (scikit-learn and scipy: of the same turn), above 1 where cfp is faster. The peers are the distribution's binaries, where they are not templates.\n")
    line("## Goals\n")

    def judged(goal, build):
        m = goal.get(build)
        if not m:
            return "", ""
        times = "x" if goal["kind"] in ("ratio", "multiple") else ""
        sign = ">=" if goal["kind"] == "ratio" else "<="
        return f"{sign} {m['goal']:g}{times}", f"{number(m['value'])}{times} {'yes' if m['met'] else '**no**'}"

    table(("", "goal, base", "measured, base; met?", "goal, native", "measured, native; met?"), [(g["goal"], *judged(g, "base"), *judged(g, "native")) for g in r["goals"]])
    notes = os.path.join(os.path.dirname(os.path.abspath(__file__)), "limits.md")
    if os.path.exists(notes):
        line(open(notes).read().strip() + "\n")
    line("## Beside the paper's timing table\n")
    line("The paper's Table V is from another machine (an i7 with an RTX 3060); its Tracking, 42.7 ms, is all of a frame in the main thread. YOLO (12.44 ms) is outside of cfp.\n")
    ms = lambda e, b: f"{e[b + '_ms']:.4f}" if b + "_ms" in e else ""
    table(("module", "paper, ms", "cfp base, ms", "cfp native, ms", "what is measured"), [(e["module"], e["paper_ms"], ms(e, "base"), ms(e, "native"), e["remark"]) for e in r["paper_table_v"]])
    line("## Ratios to peers\n")
    table(("workload: peer", "base", "native"), [(what, *[spread_text(e.get(b), lambda x: f"{number(x)}x") for b in BUILDS]) for what, e in r["ratios"].items()])
    line("## Single calls of what runs once per frame\n")
    line("Wall-clock time of each call, microseconds; the last run of each build.\n")
    timed = [(row["name"], b, c) for row in r["rows"] for b, c in row["counters"].items() if "p50_us" in c]
    table(("", "build", "50 %", "95 %", "99 %", "worst"), [(f"`{n}`", b, *[number(c[k]) for k in ("p50_us", "p95_us", "p99_us", "max_us")]) for n, b, c in timed])
    line("## Growth\n")
    line("Time as a power of the size, fitted to the medians.\n")
    table(("", "sizes", "base", "native"), [(f"`{g['name']}`", ", ".join(map(str, g["sizes"])), *[f"n^{g[b]:.2f}" if b in g else "" for b in BUILDS]) for g in r["growth"]])
    for module in TITLES:
        rows = [row for row in r["rows"] if row["module"] == module]
        if rows:
            line(f"## {TITLES[module]}\n")
            quality = lambda c: ", ".join(f"{k} {number(v)}" for k, v in sorted(c.items()) if not k.endswith("_us"))
            table(("", "base", "native", "quality"),
                  [(f"`{row['name']}`", *[spread_text(row["ns"].get(b), duration) for b in BUILDS], quality(row["counters"].get("base", row["counters"].get("native", {}))))
                   for row in rows])
        for build, by_repetition in sorted(r["texts"].get(module, {}).items()):
            line(f"## {TITLES[module]}, {build}\n")
            line("As printed by the last run.\n\n```\n" + by_repetition[max(by_repetition)] + "\n```\n")
    return "\n".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("raw")
    parser.add_argument("output")
    parser.add_argument("--seconds", type=float, default=0)
    arguments = parser.parse_args()
    results = analyse(arguments.raw, arguments.seconds)
    if not results["rows"] and not results["texts"]:
        raise SystemExit(f"{arguments.raw}: no output of any benchmark")
    results["context"] = {k: v for k, v in results["context"].items() if k not in ("host_name", "executable")}
    os.makedirs(arguments.output, exist_ok=True)
    with open(os.path.join(arguments.output, "results.json"), "w") as out:
        json.dump(results, out, indent=1)
        out.write("\n")
    with open(os.path.join(arguments.output, "RESULTS.md"), "w") as out:
        out.write(markdown(results).rstrip("\n") + "\n")


if __name__ == "__main__":
    main()
