"""Measures and prints everything: ``python -m benchmarks``."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping

from benchmarks.environments import ROWS, single, vector, whole_episodes
from benchmarks.kernels import kinematics
from benchmarks.policies import POLICIES, damped_iterations, predict_times
from benchmarks.timing import medians
from ikgym.parallel import cores


def main() -> None:
    """Prints medians and ratios; all figures of one table are from interleaved rounds of one run."""
    print(f"{cores()} cores, Python {sys.version.split()[0]}")
    print(f"import ikgym, warm: {_import_time():.2f} s\n")

    print("One step through gym.make, median")
    times = medians(single())
    _table({name: (f"{1e6 * t:8.2f} µs", _ratio(t, times["RedundantIK-v0, varga7-fast"])) for name, t in times.items()})

    for rows in ROWS:
        print(f"\nNative vector environment, {rows} arms, steps per second between resets")
        _table({name: (f"{rows / t / 1e6:8.2f} M",) for name, t in medians(vector(rows)).items()})

    whole = whole_episodes(1024) / 1e6
    print(f"\nWhole episodes of varga7-random, resets included, 1024 arms: {whole:.2f} M steps per second")

    print("\nForward kinematics and Jacobian, 7 joints, time per pose")
    calls = kinematics()
    poses = medians({name: call for name, (call, _) in calls.items()})
    per_pose = {name: t / calls[name][1] for name, t in poses.items()}
    fastest = per_pose["ikgym kernel, in a compiled loop"]
    _table({name: (f"{1e6 * t:8.3f} µs", _ratio(t, fastest)) for name, t in per_pose.items()})

    for scenario in POLICIES:
        print(f"\nOne predict on {scenario}: median, 99th percentile")
        predicting = predict_times(scenario)
        _table({name: (f"{1e6 * p50:8.1f} µs", f"{1e6 * p99:8.1f} µs") for name, (p50, p99) in predicting.items()})

    print("\nOne iteration of damped least squares inside the kernel, 7 joints")
    iterating = damped_iterations()
    spent = medians({name: call for name, (call, _) in iterating.items()})
    _table({name: (f"{1e6 * t / iterating[name][1]:8.3f} µs",) for name, t in spent.items()})


def _ratio(time: float, reference: float) -> str:
    return f"{time / reference:8.2f} x"


def _table(rows: Mapping[str, tuple[str, ...]]) -> None:
    width = max(map(len, rows))
    for name, cells in rows.items():
        print(f"  {name:<{width}}  " + "  ".join(cells))


def _import_time() -> float:
    code = "import time; t = time.perf_counter(); import ikgym; print(time.perf_counter() - t)"
    return min(
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(3)
    )


if __name__ == "__main__":
    main()
