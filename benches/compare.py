"""Hachi beside KISS-ICP and small_gicp on the same input, in the same run.

compare.py odometry INPUT [--truth FILE.tum] [--threads 1 2] [--kiss-voxel 1.0] [--max-range 100]
compare.py registration TARGET SOURCE [--reference FILE] [--voxel 0.25]

INPUT is anything `hachi replay` reads; captures are decoded by `hachi decode` for the peers, so that
all see the same points and times. Build first: cargo build --release -p hachi
"""
import argparse, glob, json, os, subprocess, sys, tempfile, time

import numpy as np
import small_gicp as sg
from scipy.spatial.transform import Rotation, Slerp

HACHI = os.environ.get("HACHI", "target/release/hachi")


def hachi(*args):
    done = subprocess.run([HACHI, *map(str, args)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


def read_ply(path):
    raw = open(path, "rb").read()
    head, body = raw.split(b"end_header\n", 1)
    kinds = {"float": "<f4", "uint": "<u4", "ushort": "<u2", "uchar": "u1", "int": "<i4", "double": "<f8"}
    fields, count = [], 0
    for line in head.decode("latin1").splitlines():
        word = line.split()
        if word[:2] == ["element", "vertex"]:
            count = int(word[2])
        elif word[:1] == ["property"]:
            fields.append((word[2], kinds[word[1]]))
    return np.frombuffer(body, np.dtype(fields), count)


def correct_kitti(points):
    from kiss_icp.pybind import kiss_icp_pybind as kiss

    return np.asarray(kiss._correct_kitti_scan(kiss._Vector3dVector(points)))


def scans(path, scratch, stamps):
    """(points n x 3, relative times or None) for each scan."""
    if os.path.isdir(path):
        # A KITTI sequence: `hachi` corrects the LiDAR's vertical angles, and so do KISS-ICP's own tools.
        is_sequence = os.path.exists(path + "/calib.txt")
        for f in sorted(glob.glob(path + ("/velodyne/*.bin" if is_sequence else "/*.bin"))):
            points = np.fromfile(f, "<f4").reshape(-1, 4)[:, :3].astype(float)
            yield correct_kitti(points) if is_sequence else points, None
        return
    hachi("decode", path, "--out", scratch, "--format", "ply")
    for f in sorted(glob.glob(scratch + "/*.ply"))[: len(stamps)]:
        a = read_ply(f)
        t = a["time_ns"].astype(float)
        yield np.stack([a["x"], a["y"], a["z"]], 1).astype(float), t / max(t.max(), 1.0)


def peers(args, threads, stamps):
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    with tempfile.TemporaryDirectory() as scratch:
        data = list(scans(args.input, scratch, stamps))
    config = load_config(None)
    config.data.max_range, config.data.min_range = args.max_range, 0.5
    config.data.deskew = data[0][1] is not None
    config.mapping.voxel_size, config.registration.max_num_threads = args.kiss_voxel, threads
    out = {}
    for name in ("kiss_icp", "small_gicp_scan", "small_gicp_map"):
        kiss, before, voxels = KissICP(config), None, None
        pose, step, poses, ms = np.eye(4), np.eye(4), [], []
        for points, times in data:
            r = np.linalg.norm(points, axis=1)
            near = (r > 0.5) & (r < args.max_range)
            p = points[near]
            t = np.zeros(len(p)) if times is None else times[near]
            begun = time.perf_counter()
            if name == "kiss_icp":
                kiss.register_frame(p, t)
                pose = kiss.last_pose.copy()
            else:
                cloud, tree = sg.preprocess_points(p, 0.25, num_threads=threads, num_neighbors=10)
                kw = {"max_correspondence_distance": 2.0, "num_threads": threads}
                if name == "small_gicp_scan":
                    if before is not None:
                        step = sg.align(before[0], cloud, before[1], step, **kw).T_target_source
                        pose = pose @ step
                    before = (cloud, tree)
                elif voxels is None:
                    voxels = sg.GaussianVoxelMap(1.0)
                    voxels.set_lru(horizon=100, clear_cycle=10)
                    voxels.insert(cloud)
                else:
                    new = sg.align(voxels, cloud, pose @ step, **kw).T_target_source
                    step, pose = np.linalg.inv(pose) @ new, new
                    voxels.insert(cloud, pose)
            ms.append((time.perf_counter() - begun) * 1e3)
            poses.append(pose.copy())
        out[name] = (np.array(poses), ms)
    return out


def aligned_error(truth, stamps, positions):
    t = np.clip(stamps, truth[0, 0], truth[-1, 0])
    ref = np.stack([np.interp(t, truth[:, 0], truth[:, k]) for k in (1, 2, 3)], 1)
    a, b = ref - ref.mean(0), positions - positions.mean(0)
    u, _, v = np.linalg.svd(a.T @ b)
    r = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
    return float(np.sqrt((np.linalg.norm(b @ r.T - a, axis=1) ** 2).mean()))


def odometry(args):
    truth = np.loadtxt(args.truth) if args.truth else None
    table = {}
    for threads in args.threads:
        with tempfile.TemporaryDirectory() as out:
            report = json.loads(hachi("replay", args.input, "--out", out, "--threads", threads, "--json"))
            path = np.loadtxt(out + "/trajectory.tum")
        stamps = path[:, 0]
        rows = {"hachi": (path[:, 1:4], report["total_per_scan_ms"]["p50"], report["total_per_scan_ms"]["mean"])}
        for name, (poses, ms) in peers(args, threads, stamps).items():
            rows[name] = (poses[:, :3, 3], float(np.median(ms)), float(np.mean(ms)))
        for name, (positions, median, mean) in rows.items():
            row = {"median_ms": round(median, 2), "mean_ms": round(mean, 2)}
            row["path_m"] = round(float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()), 3)
            if truth is not None:
                row["ate_m"] = round(aligned_error(truth, stamps[: len(positions)], positions), 4)
            table[f"{name}, {threads} threads"] = row
    print(json.dumps({"input": os.path.basename(args.input.rstrip("/")), **table}, indent=1))


def registration(args):
    def load(path):
        a = read_ply(path)
        return np.stack([a["x"], a["y"], a["z"]], 1).astype(float)

    reference = np.loadtxt(args.reference) if args.reference else None

    def off(t):
        d = np.linalg.inv(reference) @ t
        return {"metres": round(float(np.linalg.norm(d[:3, 3])), 4), "degrees": round(float(np.degrees(Rotation.from_matrix(d[:3, :3]).magnitude())), 3)}

    target, source, out = load(args.target), load(args.source), {}
    for threads in (1, 2):
        theirs, ours = [], []
        for _ in range(15):
            begun = time.perf_counter()
            tc, tt = sg.preprocess_points(target, args.voxel, num_threads=threads, num_neighbors=10)
            sc, _ = sg.preprocess_points(source, args.voxel, num_threads=threads, num_neighbors=10)
            result = sg.align(tc, sc, tt, num_threads=threads)
            theirs.append((time.perf_counter() - begun) * 1e3)
            os.environ["RAYON_NUM_THREADS"] = str(threads)
            mine = json.loads(hachi("eval", "registration", "--source", args.source, "--target", args.target, "--json"))
            ours.append(mine["time_ms"])
        row = {"hachi_ms": round(float(np.median(ours)), 2), "small_gicp_ms": round(float(np.median(theirs)), 2)}
        row["ratio"] = round(row["hachi_ms"] / row["small_gicp_ms"], 2)
        if reference is not None:
            row["hachi_off"] = off(np.array(mine["target_from_source"]).reshape(4, 4))
            row["small_gicp_off"] = off(result.T_target_source)
        out[f"threads_{threads}"] = row
    print(json.dumps(out, indent=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    o = commands.add_parser("odometry")
    o.add_argument("input")
    o.add_argument("--truth")
    o.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    o.add_argument("--kiss-voxel", type=float, default=1.0)
    o.add_argument("--max-range", type=float, default=100.0)
    o.set_defaults(run=odometry)
    r = commands.add_parser("registration")
    r.add_argument("target")
    r.add_argument("source")
    r.add_argument("--reference")
    r.add_argument("--voxel", type=float, default=0.25)
    r.set_defaults(run=registration)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
