"""Runs the tests over mutants of include/cfp; see tests/mutations/run."""
import argparse
import concurrent.futures
import csv
import os
import shlex
import sys
import time
from collections import Counter, defaultdict

from mutants import ROOT, chosen, written

sys.path.insert(0, str(ROOT / "tests/support"))
from suite import Suite, fresh, tests_of  # noqa: E402

FIELDS = "id room header line kind before after outcome test seconds".split()


def options():
    parser = argparse.ArgumentParser(prog="tests/mutations/run", description="Which tests notice a small change of include/cfp. "
                                     "CXX names the compiler (clang++).")
    parser.add_argument("--seed", default="1", help="chooses the mutants (1)")
    parser.add_argument("--count", type=int, default=150, help="mutants that compile (150)")
    parser.add_argument("--only", action="append", default=[], metavar="ROOM", help="a room or a header's name; may be repeated")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at a time")
    parser.add_argument("--tests", type=int, default=5, help="tests that a mutant must survive, the nearest first (5)")
    parser.add_argument("--again", action="store_true", help="tries earlier survivors once more")
    parser.add_argument("--sanitize", action="store_true", help="survivors meet their two nearest tests again under the sanitizers")
    parser.add_argument("--launcher", default="", help="a command that each compilation and test is given to, such as nice")
    parser.add_argument("--report", action="store_true", help="only shows the results that are there")
    return parser.parse_args()


def equivalents():
    """(header, mutated line) of the mutants that nobody can tell from the original, with the reason."""
    lines = (ROOT / "tests/mutations/equivalents.txt").read_text().splitlines()
    return {tuple(part.strip() for part in line.split(" ## ")[:2]) for line in lines if line and line[0] != "#"}


def tried(mutant, folder, plain, sanitized, limit):
    """(outcome, test, seconds): killed, survived, same code (in every test) or not compiled."""
    start, seen = time.monotonic(), False
    written(mutant, fresh(folder) / "include")
    tests = tests_of(mutant.header)[:limit]
    for suite, test in [(plain, t) for t in tests] + [(sanitized, t) for t in tests[:2] if sanitized]:
        if suite is not plain and not seen:
            break
        unchanged = suite.prepared().unchanged(test)
        if unchanged is None:
            continue
        code, target = unchanged[0], folder / "test.o"
        name = f"{test.parent.name}/{test.stem}"
        if not suite.compiled(test, target, folder / "include"):
            return "not compiled", name, time.monotonic() - start
        if target.read_bytes() == code:
            continue
        seen = True
        result = suite.linked_and_run(test, target, folder / "test", 10 + 5 * unchanged[1])
        if result != 0:
            note = " (time)" if result is None else " (sanitizer)" if suite is not plain else ""
            return "killed", name + note, time.monotonic() - start
    return "survived" if seen else "same code", "", time.monotonic() - start


def report(rows):
    known = equivalents()
    for row in rows:
        if row["outcome"] in ("survived", "same code") and (row["header"], row["after"] or ";") in known:
            row["outcome"] = "equivalent"
    rooms = defaultdict(Counter)
    for row in rows:
        rooms[row["room"]][row["outcome"]] += 1
        rooms["all"][row["outcome"]] += 1
    for row in rows:
        if row["outcome"] in ("survived", "same code"):
            print(f"\n{row['header']}:{int(row['line']) + 1}  {row['kind']}, {row['outcome']}\n- {row['before']}\n+ {row['after']}")
    print(f"\n{'room':14}{'killed':>8}{'survived':>10}{'same code':>11}{'equivalent':>12}{'killed of the rest, %':>24}")
    for room, count in sorted(rooms.items(), key=lambda item: (item[0] == "all", item[0])):
        rest = count["killed"] + count["survived"] + count["same code"]
        print(f"{room:14}{count['killed']:8}{count['survived']:10}{count['same code']:11}{count['equivalent']:12}"
              f"{100 * count['killed'] / max(rest, 1):24.1f}")
    killers = Counter(row["test"].split(" ")[0] for row in rows if row["outcome"] == "killed")
    print("\nkilled by: " + ", ".join(f"{test} {n}" for test, n in killers.most_common()))


def main():
    asked = options()
    build = ROOT / "build/mutations"
    build.mkdir(parents=True, exist_ok=True)
    table = build / "results.csv"
    rows = {row["id"]: row for row in csv.DictReader(table.open())} if table.exists() else {}
    if asked.again:
        rows = {k: row for k, row in rows.items() if row["outcome"] in ("killed", "not compiled")}
    launcher = shlex.split(asked.launcher)
    plain = Suite(build / "plain", ["-O1", "-D_GLIBCXX_ASSERTIONS"], launcher)
    strict = ["-O1", "-D_GLIBCXX_ASSERTIONS", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    sanitized = Suite(build / "sanitized", strict, launcher) if asked.sanitize else None
    order = chosen(asked.seed, asked.only)

    def done():
        mine = [rows[m.id] for m in order if m.id in rows]
        return [row for row in mine if row["outcome"] != "not compiled"][: asked.count]

    known = equivalents()
    waiting = iter([m for m in order if m.id not in rows])

    def worker(number):
        while len(done()) < asked.count:
            mutant = next(waiting, None)
            if mutant is None:
                return
            if (mutant.header, mutant.after or ";") in known:
                outcome, test, seconds = "equivalent", "", 0
            else:
                outcome, test, seconds = tried(mutant, build / f"worker{number}", plain, sanitized, asked.tests)
            rows[mutant.id] = dict(mutant._asdict(), line=mutant.line, outcome=outcome, test=test, seconds=f"{seconds:.1f}")
            print(f"{outcome:12} {seconds:6.1f} s  {mutant.header}:{mutant.line + 1}  {mutant.after[:90]}  {test}", flush=True)
            with table.open("w", newline="") as file:
                writer = csv.DictWriter(file, FIELDS)
                writer.writeheader()
                writer.writerows(rows.values())

    if not asked.report:
        plain.prepared()
        with concurrent.futures.ThreadPoolExecutor(asked.jobs) as pool:
            for finished in [pool.submit(worker, n) for n in range(asked.jobs)]:
                finished.result()
    report(done())


if __name__ == "__main__":
    main()
