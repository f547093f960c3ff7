"""Hachi beside GTSAM on the same pose graphs, in the same run.

graph.py FILE.g2o... [--runs 3] [--without-isam2]

Prints medians over the runs and ratios (hachi / gtsam; below 1 is faster or lower). Error is half the
sum of r' Omega r over the file's edges. Build first: cargo build --release -p hachi
"""
import argparse, json, os, subprocess, sys, tempfile, time

import gtsam
import numpy as np

HACHI = os.environ.get("HACHI", "target/release/hachi")


def hachi(path, solver):
    with tempfile.TemporaryDirectory() as scratch:
        out = os.path.join(scratch, "out.g2o")
        command = [HACHI, "graph", "optimize", path, "--out", out, "--solver", solver, "--json"]
        done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout)


class Peer:
    def __init__(self, path):
        with open(path) as file:
            self.space = any(line.startswith(("EDGE_SE3", "VERTEX_SE3")) for line in file)
        self.graph, self.initial = gtsam.readG2o(path, self.space)
        self.first = min(self.initial.keys())
        noise = gtsam.noiseModel.Diagonal.Variances(np.full(6 if self.space else 3, 1e-6))
        factor = gtsam.PriorFactorPose3 if self.space else gtsam.PriorFactorPose2
        self.prior = factor(self.first, self.at(self.initial, self.first), noise)
        self.held = gtsam.NonlinearFactorGraph(self.graph)
        self.held.add(self.prior)

    def at(self, values, key):
        return values.atPose3(key) if self.space else values.atPose2(key)

    def lm(self):
        begun = time.perf_counter()
        result = gtsam.LevenbergMarquardtOptimizer(self.held, self.initial, gtsam.LevenbergMarquardtParams()).optimize()
        return (time.perf_counter() - begun) * 1e3, self.graph.error(result)

    def isam2(self):
        """One pose at a time, relinearising in every update; five updates more at the end."""
        params = gtsam.ISAM2Params()
        params.setRelinearizeThreshold(0.1)
        params.relinearizeSkip = 1
        isam, by_last, ms = gtsam.ISAM2(params), {}, []
        for i in range(self.graph.size()):
            by_last.setdefault(max(self.graph.at(i).keys()), []).append(self.graph.at(i))
        estimate = isam.calculateEstimatePose3 if self.space else isam.calculateEstimatePose2
        for key in sorted(self.initial.keys()):
            new, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
            factors = by_last.get(key, [])
            step = [f for f in factors if key - 1 in list(f.keys())]
            if key != self.first and step:
                measured = step[0].measured()
                if list(step[0].keys())[0] != key - 1:
                    measured = measured.inverse()
                values.insert(key, estimate(key - 1).compose(measured))
            else:
                values.insert(key, self.at(self.initial, key))
            if key == self.first:
                new.add(self.prior)
            for factor in factors:
                new.add(factor)
            begun = time.perf_counter()
            isam.update(new, values)
            ms.append((time.perf_counter() - begun) * 1e3)
        for _ in range(5):
            isam.update()
        return ms, self.graph.error(isam.calculateBestEstimate())


def ratio(ours, theirs):
    return round(ours / theirs, 3) if theirs else None


def compare(path, runs, with_isam2):
    peer = Peer(path)
    table = {"file": os.path.basename(path)}
    mine, theirs = [], []
    for _ in range(runs):
        theirs.append(peer.lm())
        mine.append(hachi(path, "lm"))
    ours_ms, peer_ms = (float(np.median(v)) for v in ([m["time_ms"] for m in mine], [t[0] for t in theirs]))
    table["lm"] = {
        "hachi_ms": round(ours_ms, 1),
        "gtsam_ms": round(peer_ms, 1),
        "time_ratio": ratio(ours_ms, peer_ms),
        "initial_error": mine[0]["initial_error"],
        "hachi_error": mine[0]["final_error"],
        "gtsam_error": theirs[0][1],
        "error_excess": mine[0]["final_error"] / theirs[0][1] - 1.0,
    }
    if with_isam2:
        try:
            ms, error = peer.isam2()
        except RuntimeError as failure:
            table["isam2"] = {"gtsam_failed": str(failure).strip().splitlines()[0]}
            return table
        ours = hachi(path, "isam2")
        total, median, p99 = sum(ms), float(np.median(ms)), float(np.percentile(ms, 99))
        table["isam2"] = {
            "hachi_total_ms": round(ours["time_ms"], 1),
            "gtsam_total_ms": round(total, 1),
            "total_ratio": ratio(ours["time_ms"], total),
            "hachi_update_ms": ours["update_ms"],
            "gtsam_update_ms": {"median": median, "p99": p99, "max": max(ms)},
            "median_ratio": ratio(ours["update_ms"]["median"], median),
            "p99_ratio": ratio(ours["update_ms"]["p99"], p99),
            "hachi_error": ours["final_error"],
            "gtsam_error": error,
        }
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--without-isam2", action="store_true")
    args = parser.parse_args()
    print(json.dumps([compare(f, args.runs, not args.without_isam2) for f in args.files], indent=1))


if __name__ == "__main__":
    main()
