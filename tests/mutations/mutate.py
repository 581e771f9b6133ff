"""Runs the tests over mutants of include/cfp; see tests/mutations/run."""
import argparse
import concurrent.futures
import copy
import csv
import hashlib
import os
import pathlib
import shlex
import sys
import threading
import time
from collections import Counter, defaultdict

from mutants import ROOT, chosen, written
from schemata import SWITCH_UNIT, Switched

sys.path.insert(0, str(ROOT / "tests/support"))
from suite import ENGINES, TESTS, Suite, fresh, tests_of  # noqa: E402

FIELDS = "id room header line kind before after outcome test seconds".split()
FLAGS = ["-O1", "-D_GLIBCXX_ASSERTIONS"]


def options():
    parser = argparse.ArgumentParser(prog="tests/mutations/run", description="Which tests notice a small change of include/cfp. "
                                     "CXX names the compiler (clang++).")
    parser.add_argument("--seed", default="1", help="chooses the mutants (1)")
    parser.add_argument("--count", type=int, default=200, help="mutants (200)")
    parser.add_argument("--only", action="append", default=[], metavar="ROOM", help="a room or a header's name; may be repeated")
    parser.add_argument("--headers", type=int, metavar="N", help="so many of each room, chosen by the seed (all)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at a time")
    parser.add_argument("--tests", type=int, default=5, help="tests built for a mutant, the nearest first (5); those built for others run, too")
    parser.add_argument("--again", action="store_true", help="tries earlier survivors once more")
    parser.add_argument("--quick", action="store_true", help="leaves out the mutants that need builds of their own")
    parser.add_argument("--sanitize", action="store_true", help="survivors meet their two nearest tests again under the sanitizers")
    parser.add_argument("--launcher", default="", help="a command that each compilation and test is given to, such as nice")
    parser.add_argument("--report", action="store_true", help="only shows the results that are there")
    return parser.parse_args()


def mark(header, before, after):
    """What equivalents.txt calls a mutant."""
    return header, after if after not in ("", ";") else f"without {before}"


def equivalents():
    """The marks of the mutants that nobody can tell from the original; the reasons stand beside them."""
    lines = (ROOT / "tests/mutations/equivalents.txt").read_text().splitlines()
    return {tuple(part.strip() for part in line.split(" ## ")[:2]) for line in lines if line and line[0] != "#"}


class Together:
    """Programs of tests that hold every mutant which a switch can choose at run time."""

    def __init__(self, build, mutants, launcher):
        self.switched = Switched(mutants)
        self.overlay, self.list = build / "headers", build / "dropped.txt"  # not include: that is a system folder
        self.guard, self.guards, self.programs = threading.Lock(), defaultdict(threading.Lock), {}
        state = hashlib.sha1("".join(m.id for m in mutants).encode())
        for header in sorted((ROOT / "include").rglob("*.hpp")):
            state.update(header.read_bytes())
        self.key = state.hexdigest()
        key, *dropped = self.list.read_text().split() if self.list.exists() else [""]
        if key == self.key:  # the programs of an earlier run are still good
            self.switched.dropped.update(dropped)
        else:
            fresh(build)
        self.suite = Suite(build, [*FLAGS, "-ferror-limit=0", "-fno-caret-diagnostics", "-Wno-invalid-constexpr"], launcher)
        self.write()

    def write(self):
        self.switched.write(self.overlay)
        self.list.write_text("\n".join([self.key, *sorted(self.switched.dropped)]))

    def compiled(self, suite, source, target, more=()):
        while not suite.compiled(source, target, self.overlay, more):
            with self.guard:
                if not self.switched.learn(suite.output):
                    print(f"{source.stem} does not compile with switches:\n{suite.output[:2000]}", flush=True)
                    return False
                self.write()
        return True

    def prepared(self):
        self.suite.prepared()
        unit = self.suite.build / "switch.cpp"
        unit.write_text(SWITCH_UNIT)
        self.suite.run([*self.suite.compiler, "-c", str(unit), "-o", str(unit.with_suffix(".o"))], 60, check=True)
        return self

    def program(self, test):
        """(program, seconds without a mutant), or None where the test does not pass."""
        with self.guards[test]:
            if test not in self.programs:
                self.programs[test] = self.built(test)
            return self.programs[test]

    def built(self, test):
        suite, build = copy.copy(self.suite), self.suite.build
        program = build / "-".join(test.relative_to(TESTS).with_suffix("").parts)
        target, parts, room = program.with_suffix(".o"), [build / "switch.o"], test.parent.name
        engines, more = ENGINES.get(room, (None, []))
        if engines:
            parts.append(build / f"{room}-engines.o")
            with self.guards[engines]:
                if not parts[-1].exists() and not self.compiled(suite, engines, parts[-1], more):
                    return None
        if not suite.is_fresh(test, target):
            program.unlink(missing_ok=True)
            if not self.compiled(suite, test, target, more):
                return None
        if not program.exists() and not suite.linked(test.parent.name, [target, *parts], program):
            return None
        start = time.monotonic()
        return (program, time.monotonic() - start) if suite.run([str(program)], 300, CFP_MUTANT="0") == 0 else None

    def tried(self, mutant, limit):
        """(outcome, test, seconds), or None for a mutant that needs a build of its own."""
        start, seen = time.monotonic(), False
        near, far = tests_of(mutant.header)[:limit], tests_of(mutant.header)[limit:]
        for test in near + [t for t in far if self.programs.get(t)]:
            built = self.program(test)
            if mutant.id in self.switched.dropped:
                return None
            if not built:
                continue
            seen = True
            result = copy.copy(self.suite).run([str(built[0]), "--abort"], 10 + 5 * built[1], CFP_MUTANT=str(self.switched.number[mutant.id]))
            if result != 0:
                note = " (time)" if result is None else ""
                return "killed", f"{test.parent.name}/{test.stem}{note}", time.monotonic() - start
        return ("survived", "", time.monotonic() - start) if seen else None


def alone(mutant, folder, plain, sanitized, limit):
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


def report(rows, missing):
    known = equivalents()
    for row in rows:
        if row["outcome"] in ("survived", "same code") and mark(row["header"], row["before"], row["after"]) in known:
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
    print(f"\n{rooms['all']['not compiled']} do not compile, {missing} not tried")


def main():
    asked = options()
    build = ROOT / "build/mutations"
    build.mkdir(parents=True, exist_ok=True)
    table = build / "results.csv"
    rows = {row["id"]: row for row in csv.DictReader(table.open())} if table.exists() else {}
    if asked.again:
        rows = {k: row for k, row in rows.items() if row["outcome"] in ("killed", "not compiled")}
    launcher = shlex.split(asked.launcher)
    mutants, known, guard = chosen(asked.seed, asked.only, asked.headers)[: asked.count], equivalents(), threading.Lock()

    def note(mutant, outcome, test="", seconds=0.0):
        with guard:
            rows[mutant.id] = dict(mutant._asdict(), outcome=outcome, test=test, seconds=f"{seconds:.1f}")
            print(f"{outcome:12} {seconds:6.1f} s  {mutant.header}:{mutant.line + 1}  {mutant.after[:90]}  {test}", flush=True)
            part = pathlib.Path(f"{table}.part")
            with part.open("w", newline="") as file:
                writer = csv.DictWriter(file, FIELDS)
                writer.writeheader()
                writer.writerows(rows.values())
            part.replace(table)

    def over(waiting, try_one):
        queue, lock = iter(waiting), threading.Lock()

        def worker(number):
            while True:
                with lock:
                    mutant = next(queue, None)
                if mutant is None:
                    return
                result = try_one(mutant, number)
                if result:
                    note(mutant, *result)

        with concurrent.futures.ThreadPoolExecutor(asked.jobs) as pool:
            for finished in [pool.submit(worker, n) for n in range(asked.jobs)]:
                finished.result()

    if not asked.report:
        for mutant in mutants:
            if mutant.id not in rows and mark(mutant.header, mutant.before, mutant.after) in known:
                note(mutant, "equivalent")
        together = Together(build / "together", mutants, launcher).prepared()
        over([m for m in mutants if m.id not in rows], lambda m, _: together.tried(m, asked.tests))
    if not asked.report and not asked.quick:
        strict = [*FLAGS, "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
        plain = Suite(build / "plain", FLAGS, launcher).prepared()
        sanitized = Suite(build / "sanitized", strict, launcher) if asked.sanitize else None
        over([m for m in mutants if m.id not in rows],
             lambda m, number: alone(m, build / f"worker{number}", plain, sanitized, asked.tests))
    report([rows[m.id] for m in mutants if m.id in rows], sum(m.id not in rows for m in mutants))


if __name__ == "__main__":
    main()
