"""Whole flights, side by side: what a run costs beside merely reading the same columns.

    pip install polars pyarrow numpy numba
    cargo build --release --locked
    python benches/end_to_end.py target/release/freeplay

Makes wide logs (eight actuators x a million rows each, plain values under zstd, the layout other programs write, and
the same once more as codes of dictionaries, which pyarrow writes unless told otherwise), then lets Freeplay, a reader
and the strongest Python peer go over them in turn, several rounds in one session, each in a process of its own. CPU
seconds and peak memory are the operating system's account of that process; Python's are less its start and imports.
Prints Markdown; times on a busy machine move together, ratios less.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

POSITIONS = [f"surface_{n}" for n in range(1, 9)]
RATE_HZ = 500.0

SPEC = """
seed = 8
tails = ["N801FP"]
flights_per_tail = {flights}
flight_hours = {hours}
[profile]
duration_s = {duration}
sample_rate_hz = {rate}
[sensors.motor]
noise_rms = 1e-6
[sensors.screw]
noise_rms = 3e-6
resolution = 1.9e-6
[sensors.load]
noise_rms = 20.0
resolution = 1.0
[[parts]]
part_number = "EMA-8"
motor_log = "angle"
[parts.plant]
contact = {{ stiffness_n_per_m = 5e7, damping_n_s_per_m = 2000.0 }}
"""


def make(freeplay, folder, flights, rows, actuators):
    """Logs as other programs write them, and the configuration and truth that belong to them."""
    import pyarrow.parquet as pq

    spec = folder / "spec.toml"
    duration = rows / RATE_HZ
    text = SPEC.format(flights=flights, hours=duration / 3600, duration=duration, rate=RATE_HZ)
    for position in POSITIONS[:actuators]:
        text += f'[[positions]]\nposition = "{position}"\npart_number = "EMA-8"\n'
    spec.write_text(text)
    subprocess.run([freeplay, "simulate", spec, "--output", folder / "fleet", "-q"], check=True)
    logs = sorted((folder / "fleet" / "logs").rglob("*.parquet"))
    for log in logs:
        table = as_doubles(pq.read_table(log)).replace_schema_metadata(identity(log))
        pq.write_table(table, log, compression="zstd", compression_level=1, use_dictionary=False, row_group_size=131072)
        # Unless told otherwise, pyarrow writes values as codes of dictionaries.
        copy = folder / "coded" / log.name
        copy.parent.mkdir(exist_ok=True)
        pq.write_table(table, copy, compression="zstd")


def identity(log):
    """What the footer says of the flight."""
    import pyarrow.parquet as pq

    kept = pq.read_metadata(log).metadata
    return {key: value for key, value in kept.items() if not key.startswith(b"ARROW:")}


def as_doubles(table):
    """Full doubles on each channel's grid: a float widened would compress as no recorder's double does."""
    import pyarrow as pa

    step = {"deg": 360 / 2**20, "mm": 1e-4, "n": 0.1}
    columns = []
    for name in table.column_names:
        values = table[name].to_numpy().astype(float)
        grid = step.get(name.rsplit("_", 1)[-1])
        columns.append(pa.array(values if grid is None else (values / grid).round() * grid))
    return pa.table(columns, names=table.column_names)


def measured(command, **environment):
    """Runs a command; its user and system seconds, its peak memory in MB and what it printed last."""
    with tempfile.TemporaryFile("w+") as out:
        child = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL, env={**os.environ, **environment})
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        said = out.read().strip().splitlines()
    if child.returncode != 0:
        raise SystemExit(f"{command} ended with code {child.returncode}")
    return {"cpu_s": usage.ru_utime + usage.ru_stime, "mb": usage.ru_maxrss / 1024, "said": said[-1] if said else ""}


# What runs in the Python processes: `columns` and `logs` are given as JSON on the command line.
PEER = r"""
import json, resource, sys, time
kind, logs, columns, part = json.loads(sys.argv[1])
import numpy as np
if kind.startswith("polars"):
    import polars as pl
    read = lambda log: {c: v.to_numpy() for c, v in zip(columns, pl.read_parquet(log, columns=columns).get_columns())}
else:
    import pyarrow.parquet as pq
    read = lambda log: {c: v.to_numpy() for c, v in zip(columns, pq.read_table(log, columns=columns, use_threads=False).columns)}

if kind.endswith("filter"):
    from numba import njit
    @njit(cache=False)
    def gap(dx, load, gain, f, g):
        a = b = s = 0.0
        out = np.empty(dx.size)
        for k in range(dx.size):
            u = load[k] * g
            na = f[0] * a + f[1] * b + f[2] * s + u + gain[0] * dx[k]
            nb = f[3] * a + f[4] * b + f[5] * s + u + gain[1] * dx[k]
            ns = f[6] * a + f[7] * b + f[8] * s + gain[2] * dx[k]
            a, b, s = na, nb, ns
            out[k] = s
        middle = (out.min() + out.max()) / 2
        up = 0.0; n = 0; down = 0.0; m = 0
        for v in out:
            if v > middle: up += v; n += 1
            else: down += v; m += 1
        return up / max(n, 1) - down / max(m, 1)
    f = np.array([0.6, 0.0, 0.0, 0.0, 0.6, 0.0, -0.1, 0.0, 0.9]); gain = np.array([0.3, 0.3, 0.1])
    gap(np.zeros(8), np.zeros(8), gain, f, 1e-9)

def used():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime

for log in logs[:1]:
    read(log)  # pays for what is loaded on first use
before = used()
for log in logs:
    held = read(log)
    if kind.endswith("filter"):
        for position in part:
            motor, screw, load = (held[c] for c in position)
            gap(screw - motor * (0.005 / (2 * np.pi)), load, gain, f, 1e-9)
    del held
print(used() - before)
"""


def peers(kind, logs, columns, positions, threads):
    arguments = json.dumps([kind, [str(log) for log in logs], columns, positions])
    one = measured([sys.executable, "-c", PEER, arguments], POLARS_MAX_THREADS=str(threads))
    return {"cpu_s": float(one["said"]), "mb": one["mb"]}


def run(freeplay, folder, logs, method, jobs):
    """A whole nightly run into a new store: read, digested, estimated by both methods, committed."""
    store = folder / f"store-{method}-{jobs}"
    shutil.rmtree(store, ignore_errors=True)
    settings = (folder / "fleet" / "pipeline.toml").read_text()
    settings = settings.replace('"logs/**/*.parquet"', f'"{logs}"').replace('"results"', f'"{store}"')
    config = folder / "fleet" / f"{method}-{jobs}.toml"
    config.write_text(f'{settings}\n[estimate]\nmethod = "{method}"\n')
    return measured([freeplay, "--config", str(config), "run", "-q", "--jobs", str(jobs)])


def foreign_columns(actuators):
    kinds = ("motor_deg", "screw_mm", "load_n")
    return [[f"{position}_{kind}" for kind in kinds] for position in POSITIONS[:actuators]]


def contestants(args, folder, logs, normalized):
    """What runs in each round, by name: a call that gives CPU seconds and peak memory."""
    positions = foreign_columns(args.actuators)
    columns = [column for position in positions for column in position]
    theirs = str(folder / "fleet" / "logs" / "**" / "*.parquet")
    calls = {
        "polars reads": lambda: peers("polars", logs, columns, positions, 1),
        "pyarrow reads": lambda: peers("pyarrow", logs, columns, positions, 1),
        "polars, numba filter": lambda: peers("polars-filter", logs, columns, positions, 1),
        "freeplay, contact": lambda: run(args.freeplay, folder, theirs, "contact", 1),
        "freeplay, midrange": lambda: run(args.freeplay, folder, theirs, "midrange", 1),
        "freeplay, contact, two workers": lambda: run(args.freeplay, folder, theirs, "contact", 2),
    }
    codes = sorted((folder / "coded").glob("*.parquet"))
    pattern = str(folder / "coded" / "*.parquet")
    for reader in ("polars", "pyarrow"):
        calls[f"{reader} reads codes"] = lambda r=reader: peers(r, codes, columns, positions, 1)
    calls["freeplay, contact, from codes"] = lambda p=pattern: run(args.freeplay, folder, p, "contact", 1)
    for encoding, ours in normalized.items():
        files = [str(log) for log in sorted(ours.rglob("*.parquet"))]
        plain = ["motor_m", "dx_m", "load_n"]
        for reader in ("polars", "pyarrow"):
            calls[f"{reader} reads ours, {encoding}"] = lambda r=reader, f=files: peers(r, f, plain, [], 1)
        pattern = str(ours / "**" / "*.parquet")
        calls[f"freeplay from ours, {encoding}"] = lambda p=pattern: run(args.freeplay, folder, p, "contact", 1)
    return calls


def normalize(args, folder, logs):
    made = {}
    for encoding in ("split", "compatible"):
        made[encoding] = folder / encoding
        if not made[encoding].exists():
            config = folder / "fleet" / "pipeline.toml"
            command = [args.freeplay, "--config", config, "normalize", *logs, "--output", made[encoding]]
            subprocess.run([*command, "--encoding", encoding, "-q"], check=True, stdout=subprocess.DEVNULL)
    return made


def accuracy(args, folder):
    """Worst error of the gaps against the simulated truth, so that speed is not bought with it."""
    store = ["--config", str(folder / "fleet" / "contact-1.toml"), "store", "export", "--format", "csv"]
    said = subprocess.run([args.freeplay, *store], check=True, capture_output=True, text=True).stdout
    code = (
        "import io, sys, polars as pl\n"
        "found = pl.read_csv(io.StringIO(sys.stdin.read()))\n"
        "truth = pl.read_parquet(sys.argv[1]).select('flight_id', 'position', true_m='gap_m')\n"
        "both = found.join(truth, on=['flight_id', 'position'])\n"
        "print(both.height, (both['gap_m'] / both['true_m'] - 1).abs().max())"
    )
    truth = str(folder / "fleet" / "truth.parquet")
    count, worst = subprocess.run(
        [sys.executable, "-c", code, truth], input=said, check=True, capture_output=True, text=True
    ).stdout.split()
    return int(count), float(worst)


def table(rounds, logs):
    floor = [one["cpu_s"] for one in rounds["polars reads"]]
    lines = ["| what | CPU s a flight | ratio to polars reading, each round | peak MB |", "|---|---|---|---|"]
    for name, results in rounds.items():
        spent = [one["cpu_s"] for one in results]
        ratios = ", ".join(f"{a / b:.2f}" for a, b in zip(spent, floor))
        least = min(spent) / len(logs)
        lines.append(f"| {name} | {least:.3f} | {ratios} | {max(one['mb'] for one in results):.0f} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("freeplay", type=lambda text: str(Path(text).resolve()))
    parser.add_argument("--flights", type=int, default=4)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--actuators", type=int, default=8, choices=range(1, 9))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="where the logs are made, and found again")
    parser.add_argument("--make", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    folder = (args.folder or Path(tempfile.mkdtemp(prefix="freeplay-bench-"))).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if args.make:
        make(args.freeplay, folder, args.flights, args.rows, args.actuators)
        return
    if not (folder / "fleet").exists():
        # In a process of its own: a child's peak memory counts what its parent held when it was born.
        shape = ["--flights", args.flights, "--rows", args.rows, "--actuators", args.actuators]
        made = [sys.executable, __file__, args.freeplay, "--make", "--folder", folder, *shape]
        subprocess.run([str(word) for word in made], check=True, stdout=subprocess.DEVNULL)
    logs = sorted((folder / "fleet" / "logs").rglob("*.parquet"))
    calls = contestants(args, folder, logs, normalize(args, folder, logs))
    rounds = {name: [] for name in calls}
    for number in range(args.rounds):
        for name, call in calls.items():
            rounds[name].append(call())
            print(f"round {number + 1}: {name}: {rounds[name][-1]['cpu_s']:.2f} CPU s", file=sys.stderr)
    size = sum(log.stat().st_size for log in logs) / len(logs) / 1e6
    print(f"{len(logs)} flights of {args.actuators} actuators × {args.rows} rows, {size:.0f} MB each, {args.rounds} rounds\n")
    print(table(rounds, logs))
    count, worst = accuracy(args, folder)
    print(f"\nWorst error of {count} gaps against the truth: {100 * worst:.2f} %.")


if __name__ == "__main__":
    main()
