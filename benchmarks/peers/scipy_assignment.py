#!/usr/bin/env python3
"""Times scipy.optimize.linear_sum_assignment on the kinds of matrices of assignment_benchmark.cpp (the Python call included).
Prints JSON: nanoseconds of processor time per call, medians, inputs rotating."""
import json
import time

import numpy as np
import scipy
from scipy.optimize import linear_sum_assignment


def boxes(rng, n):
    corner = rng.uniform([0, 0], [580, 380], (n, 2))
    return np.hstack([corner, corner + rng.uniform([30, 60], [120, 240], (n, 2))])


def one_minus_iou(a, b):
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    common = np.prod(np.clip(high - low, 0, None), axis=2)
    area = lambda x: np.prod(x[:, 2:] - x[:, :2], axis=1)
    return 1 - common / (area(a)[:, None] + area(b)[None, :] - common)


def problem(rng, rows, cols, uniform):
    if uniform:
        return rng.uniform(size=(rows, cols))
    left, right = boxes(rng, rows), boxes(rng, cols)
    right[: min(rows, cols)] = left[: min(rows, cols)] + np.tile(6 * rng.standard_normal((min(rows, cols), 2)), 2)
    return one_minus_iou(left, right[rng.permutation(cols)])


def main():
    rng = np.random.default_rng(7)
    times = {}
    for uniform in (0, 1):
        for rows, cols in [(5, 5), (5, 8), (10, 10), (10, 15), (50, 50), (50, 80), (200, 200), (200, 300)]:
            problems = [problem(rng, rows, cols, uniform) for _ in range(64)]
            medians = []
            for _ in range(15 if rows < 200 else 5):
                start = time.process_time()
                for costs in problems:
                    linear_sum_assignment(costs)
                medians.append((time.process_time() - start) / len(problems))
            times[f"scipy/rows:{rows}/cols:{cols}/uniform:{uniform}"] = 1e9 * float(np.median(medians))
    print(json.dumps({"versions": {"scipy": scipy.__version__}, "times_ns": times}))


if __name__ == "__main__":
    main()
