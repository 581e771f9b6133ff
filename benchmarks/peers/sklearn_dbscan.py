#!/usr/bin/env python3
"""scikit-learn's DBSCAN on the boxes of clustering_benchmark (same distribution). Prints JSON: nanoseconds of processor time
per call, medians, inputs rotating, and the mean numbers of clusters and noise points."""
import json
import statistics
import time

import numpy
import sklearn
from sklearn.cluster import DBSCAN


def box(generator, n):
    kind = generator.uniform(size=n)
    person, wall = 2.0 + 0.12 * generator.randn(n), 3.5 + 0.05 * generator.randn(n)
    return numpy.where(kind < 0.5, person, numpy.where(kind < 0.9, wall, generator.uniform(1, 6, n))).reshape(-1, 1)


generator = numpy.random.RandomState(1)
times_ns, quality = {}, {}
for n in (12, 50, 200, 1000, 5000):
    boxes = [box(generator, n) for _ in range(64)]
    times, clusters, noise = [], 0.0, 0.0
    for repeat in range(3 if n <= 1000 else 1):
        for values in boxes if n <= 1000 else boxes[:16]:
            start = time.process_time()
            labels = DBSCAN(eps=0.05, min_samples=5).fit(values).labels_
            times.append((time.process_time() - start) * 1e6)
            clusters += labels.max() + 1
            noise += (labels < 0).sum()
    times_ns[f"sklearn/{n}"] = 1e3 * statistics.median(times)
    quality[f"sklearn/{n}"] = {"clusters": clusters / len(times), "noise": noise / len(times)}
print(json.dumps({"versions": {"scikit-learn": sklearn.__version__}, "times_ns": times_ns, "quality": quality}))
