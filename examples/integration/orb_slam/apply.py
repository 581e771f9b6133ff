#!/usr/bin/env python3
"""Applies the recipe of README.md to a checkout of ORB-SLAM2 or ORB-SLAM3, by function names.

Changes nothing unless every place of steps.py is found exactly as often as expected.
"""
import argparse
import re
import sys
from pathlib import Path

from steps import BOTH, ORB_SLAM2, ORB_SLAM3


def scope(text, function):
    """Begin and end of the definition of a function, which ends at the first closing brace in column 0."""
    if not function:
        return 0, len(text)
    found = re.search(r"^[^\s/].*" + re.escape(function), text, re.M) or re.search("^" + re.escape(function), text, re.M)
    if not found:
        return None
    end = text.find("\n}", found.start())
    return found.start(), len(text) if end < 0 else end


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("folder", type=Path, help="of ORB-SLAM2 or ORB-SLAM3")
    arguments.add_argument("--check", action="store_true", help="only look")
    options = arguments.parse_args()
    root, texts, failures = options.folder, {}, 0
    system, own = ("ORB-SLAM3", ORB_SLAM3) if (root / "include/Atlas.h").is_file() else ("ORB-SLAM2", ORB_SLAM2)
    for step, name, function, pattern, replacement, times in own + BOTH:
        path = root / name
        if path not in texts:
            if not path.is_file():
                sys.exit(f"{path} is not there: {root} is no checkout of {system}")
            texts[path] = path.read_text(encoding="utf-8", errors="surrogateescape").replace("\r\n", "\n")
            if any(mark in texts[path] for mark in ("engines.cc", "mpStaticWeights", "mStaticProbability")):
                sys.exit(f"{path} has been changed already: take a fresh checkout")
        where = scope(texts[path], function)
        begin, end = where or (0, 0)
        part, found = re.subn(pattern, replacement, texts[path][begin:end])
        if found != times:
            failures += 1
            print(f"step {step}: {name}, {function or 'file'}: {pattern} found {found} times, expected {times}")
        texts[path] = texts[path][:begin] + part + texts[path][end:]
    if failures:
        sys.exit(f"{failures} places differ from {system} as it was published; nothing was changed")
    if not options.check:
        for path, text in texts.items():
            path.write_text(text, encoding="utf-8", errors="surrogateescape")
    done = "found, nothing was changed" if options.check else "changed"
    print(f"{system}: {len(own + BOTH)} places in {len(texts)} files {done}")


if __name__ == "__main__":
    main()
