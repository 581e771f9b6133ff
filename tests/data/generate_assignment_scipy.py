#!/usr/bin/env python3
"""Writes assignment_scipy.csv: cost matrices and their optimum by scipy.optimize.linear_sum_assignment.

One problem per line: rows, cols, gate, optimal objective, rows * cols costs. Objective: sum of the pairs' costs plus gate per pair
left out of min(rows, cols); with gate inf just the sum (all pairs exist there). Usage: generate_assignment_scipy.py > assignment_scipy.csv
"""
import numpy as np
from scipy.optimize import linear_sum_assignment


def optimum(costs, gate):
    rows, cols = costs.shape
    if np.isinf(gate):
        i, j = linear_sum_assignment(costs)
        return costs[i, j].sum()
    # A private dummy column of cost `gate` per row; forbidden pairs get a cost that is never worth it.
    big = 1e3 * (1 + abs(gate) + np.abs(costs[np.isfinite(costs)]).sum())
    dummies = np.where(np.eye(rows, dtype=bool), gate, big)
    allowed = np.where(np.isfinite(costs) & (costs < gate), costs, big)
    i, j = linear_sum_assignment(np.hstack([allowed, dummies]))
    pairs = j < cols
    return allowed[i[pairs], j[pairs]].sum() + gate * (min(rows, cols) - pairs.sum())


def main():
    rng = np.random.default_rng(20)
    print("# written by generate_assignment_scipy.py; scipy " + __import__("scipy").__version__)
    for rows, cols in [(1, 1), (3, 5), (5, 3), (8, 8), (12, 7), (7, 12), (15, 15)]:
        for kind in range(3):
            costs = rng.uniform(size=(rows, cols)) if kind != 1 else rng.integers(0, 5, (rows, cols)).astype(float)
            if kind == 2:
                costs = 2 * costs - 1
            for gate in [np.inf, 0.6, 0.15]:
                matrix = costs.copy()
                if np.isfinite(gate):
                    matrix[rng.uniform(size=matrix.shape) < 0.3] = np.inf
                numbers = [rows, cols, gate, optimum(matrix, gate), *matrix.ravel()]
                print(",".join(f"{x:.17g}" if isinstance(x, float) else str(x) for x in numbers))


if __name__ == "__main__":
    main()
