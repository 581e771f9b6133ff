"""The tests as programs of one file each: which of them read a header, how they are built, run and timed."""
import os
import pathlib
import re
import resource
import shlex
import shutil
import signal
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"
ROOMS = "core simd math geometry detection clustering probability robust optimization frame evaluation interop properties".split()
PRECOMPILED = ["support/catch.hpp", *(f"<{h}>" for h in "Eigen/Core algorithm array cmath functional limits string vector".split())]

ENGINES = {  # what the tests of a room instantiate alike, compiled once, and the flag that leaves it to that
    "frame": (TESTS / "support/engines.cpp", ["-DCFP_TEST_ENGINES_LINKED"]),
    "interop": (ROOT / "examples/integration/engines.cc", []),
}


def output_of(*command):
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    except (OSError, subprocess.CalledProcessError):
        return []


def limited_to(seconds, bytes_of_data):
    """Limits of a child: processor time, so that a busy machine kills no mutant, memory, and no core files."""

    def limit():
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 1))
        resource.setrlimit(resource.RLIMIT_DATA, (bytes_of_data, bytes_of_data))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    return limit


class Suite:
    """One compiler with one set of flags: the precompiled header that all tests share, and how a test is built and run."""

    def __init__(self, build, flags, launcher=(), compiler=None, emulator=()):
        self.build, self.launcher, self.emulator = build, list(launcher), list(emulator)
        build.mkdir(parents=True, exist_ok=True)
        self.compiler = compiler or shlex.split(os.environ.get("CXX", "clang++"))
        version = output_of("sh", "-c", "grep -h 'define CATCH_VERSION_MAJOR' /usr/include/catch2/*.hpp")
        # Catch2 beside the system's headers, not among them: those of another machine must not be read.
        apart = build / "include"
        apart.mkdir(exist_ok=True)
        if not (apart / "catch2").exists():
            (apart / "catch2").symlink_to("/usr/include/catch2")
        self.flags = [*flags, *([] if any(f.startswith("-std=") for f in flags) else ["-std=c++17"]), "-w"]
        self.flags += [f"-I{TESTS}", f"-I{ROOT}/include", f"-I{ROOT}/examples", "-isystem", str(apart)]
        self.flags += [f'-DCFP_TEST_DATA_DEFAULT="{ROOT.parent}/shared/data"', f'-DCFP_SOURCE_DIR="{ROOT}"']
        self.flags += ["-DCFP_TEST_CATCH2_V2"] if version[-1:] == ["2"] else []
        self.flags += [f.replace("-I", "-isystem") for f in output_of("pkg-config", "--cflags", "eigen3") or ["-I/usr/include/eigen3"]]
        self.opencv = [output_of("pkg-config", kind, "opencv4") for kind in ("--cflags", "--libs")]
        self.baseline = {}

    def prepared(self):
        """Builds what all tests share."""
        header, made_with = self.build / "all.hpp", self.build / "flags.txt"
        flags = " ".join([*self.compiler, *self.flags])
        if made_with.exists() and made_with.read_text() == flags:
            return self
        for old in self.build.glob("*.o"):
            old.unlink()
        header.write_text("".join(f"#include {h if h[0] == '<' else chr(34) + h + chr(34)}\n" for h in PRECOMPILED))
        self.run([*self.compiler, *self.flags, "-x", "c++-header", str(header), "-o", f"{header}.gch"], 300, check=True)
        for name in ("main", "allocation_counter"):
            self.run([*self.compiler, *self.flags, "-c", f"{TESTS}/support/{name}.cpp", "-o", f"{self.build}/{name}.o"], 300, check=True)
        made_with.write_text(flags)
        return self

    def run(self, command, seconds, check=False, **variables):
        """Return code, or None when time ran out: `seconds` of the processor, or four times that and a minute by the clock."""
        environment = dict(os.environ, RC_PARAMS="seed=20261121", ASAN_OPTIONS="detect_leaks=0", **variables)
        shadow = self.emulator or any("-fsanitize" in flag for flag in self.flags)
        limit = limited_to(seconds, resource.RLIM_INFINITY if shadow else 4 << 30)
        process = subprocess.Popen([*self.launcher, *command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   env=environment, preexec_fn=limit, start_new_session=True, errors="replace")
        try:
            self.output, _ = process.communicate(timeout=60 + 4 * seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            process.wait()
            return None
        if check and process.returncode:
            raise SystemExit(f"{' '.join(command)}\n{self.output[-3000:]}")
        return None if process.returncode == -signal.SIGXCPU else process.returncode

    def can_build(self, test):
        """Whether the machine has what a test needs beside Catch2 and Eigen."""
        needs = {"interop": self.opencv[0], "properties": pathlib.Path("/usr/include/rapidcheck").exists()}
        return needs.get(test.parent.name, True)

    def compiled(self, test, target, overlay=None, more=()):
        """True when the test compiles, with the headers of `overlay` in front of the library's."""
        front = [f"-I{overlay}", f"-ffile-prefix-map={overlay}={ROOT}/include"] if overlay else []
        extra = self.opencv[0] if test.parent.name in ("interop", "orb_slam") else []
        command = [*self.compiler, *front, *self.flags, *more, *extra, "-include", str(self.build / "all.hpp"), "-c", str(test), "-o", str(target)]
        return self.run(command, 300) == 0

    def linked(self, room, objects, program):
        libraries = {"properties": ["-lrapidcheck"], "interop": self.opencv[1]}.get(room, [])
        parts = [str(o) for o in (*objects, self.build / "main.o", self.build / "allocation_counter.o")]
        return self.run([*self.compiler, *self.flags, *parts, *libraries, "-pthread", "-o", str(program)], 120) == 0

    def linked_and_run(self, test, compiled, program, seconds):
        """Return code of the tests up to the first that fails: 0 passed, None out of time."""
        if not self.linked(test.parent.name, [compiled], program):
            return 1
        code = self.run([*self.emulator, str(program), "--abort"], seconds)
        program.unlink(missing_ok=True)
        return code

    def is_fresh(self, test, target):
        """Whether an object file is newer than all that its test reads."""
        return target.exists() and all(p.stat().st_mtime < target.stat().st_mtime for p in (test, *includes_of(test)))

    def unchanged(self, test):
        """(object code, seconds) of the test without mutation, or None when it does not pass here."""
        if test not in self.baseline:
            name = "-".join(test.relative_to(TESTS).with_suffix("").parts)
            target = self.build / f"{name}.o"
            fits = self.is_fresh(test, target) or self.compiled(test, target)
            start = time.monotonic()
            fits = fits and self.linked_and_run(test, target, self.build / name, 300) == 0
            self.baseline[test] = (target.read_bytes(), time.monotonic() - start) if fits else None
        return self.baseline[test]


def includes_of(path, cache={}):
    """Every file of the repository that `path` reads, with its distance in steps."""
    if path in cache:
        return cache[path]
    found, front, steps = {}, [path], 0
    while front:
        steps += 1
        names = [n for p in front for n in re.findall(r'#include "([^"]+)"', p.read_text())]
        paths = [r / n for n in names for r in (TESTS, ROOT / "include", ROOT / "examples") if (r / n).exists()]
        front = [p for p in dict.fromkeys(paths) if p not in found]
        found.update((p, steps) for p in front)
    cache[path] = found
    return found


def tests_of(header):
    """The tests that read a header: its mirror, its room's, properties, then the others, the nearest first."""
    path = ROOT / "include" / header
    room, stem = header.split("/")[1], path.stem.removesuffix("_impl")
    ranked = []
    for test in (t for area in ROOMS for t in (TESTS / area).glob("*_test.cpp")):
        steps = includes_of(test).get(path)
        if steps is None or "_ceres_" in test.name or (test.parent.name == "interop" and room != "interop"):
            continue
        of_all = ("defaults_test", "option_bounds_test")  # of every room, though they stand in core
        mirror, at_home = test.stem.startswith(f"{stem}_"), test.parent.name == room or test.stem in of_all
        of_room = test.stem in (*of_all, f"{room}_properties_test")
        ranked.append((not mirror, not at_home, not of_room, steps, test.parent.name != "properties", test.stat().st_size, test))
    return [entry[-1] for entry in sorted(ranked)]


def fresh(folder):
    shutil.rmtree(folder, ignore_errors=True)
    pathlib.Path(folder).mkdir(parents=True)
    return folder
