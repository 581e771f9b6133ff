#!/usr/bin/env python3
"""Writes dbscan_table.txt: scalar values and scikit-learn's DBSCAN labels for them.

    python3 tests/data/generate_dbscan_table.py > tests/data/dbscan_table.txt

One case per line: eps min_pts n, then n values, then n labels. Values and eps are multiples of 1/1024, so that distances are exact
in every floating-point type and distances equal to eps occur. scikit-learn gives a border point to the cluster that finds it first; that
freedom is left to the reader of the table (the test asks for agreement on core points, noise and the partition).
"""
import numpy
from sklearn.cluster import DBSCAN
import sklearn

generator = numpy.random.RandomState(2026)
print("# scikit-learn", sklearn.__version__, "numpy", numpy.__version__, "RandomState(2026): eps min_pts n values... labels...")
for case in range(40):
    n = int(generator.choice([1, 5, 12, 30, 60, 120]))
    layers = generator.uniform(1, 6, size=3)
    values = numpy.where(generator.uniform(size=n) < 0.2, generator.uniform(0.5, 8, n), generator.choice(layers, n) + 0.1 * generator.randn(n))
    grid = 1024 if case % 2 else 32
    values = numpy.round(values * grid) / grid
    eps = float(generator.choice([1 / 32, 1 / 16, 3 / 32, 1 / 8, 0.25]))
    min_pts = int(generator.randint(1, 9))
    labels = DBSCAN(eps=eps, min_samples=min_pts).fit(values.reshape(-1, 1)).labels_
    print(eps, min_pts, n, *[repr(float(v)) for v in values], *labels)
