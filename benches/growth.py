"""How the cost of a run grows with rows, files and actuators, over three decades each.

    pip install matplotlib
    cargo build --release --locked
    python benches/growth.py target/release/freeplay --picture growth.svg

Makes logs of one actuator with 10,000 to 10,000,000 rows, folders of 1 to 1,000 logs, and logs of 1 to 1,000
actuators; runs each into a new store with one worker, the series in turn. CPU seconds are the operating system's
account, the least of the rounds; what a run costs that finds nothing to estimate is taken off in the picture. Prints
Markdown.
"""

import argparse
import math
import shutil
import subprocess
import tempfile
from pathlib import Path

from end_to_end import RATE_HZ, SPEC, measured

DECADES = [1, 3, 10, 30, 100, 300, 1000]


def fleet(freeplay, folder, flights, rows, actuators):
    """A simulated fleet: where its configuration is. Made once."""
    if not (folder / "pipeline.toml").exists():
        seconds = rows / RATE_HZ
        text = SPEC.format(flights=flights, hours=seconds / 3600, duration=seconds, rate=RATE_HZ)
        for k in range(actuators):
            text += f'[[positions]]\nposition = "surface_{k}"\npart_number = "EMA-8"\n'
        folder.parent.mkdir(parents=True, exist_ok=True)
        spec = folder.with_suffix(".toml")
        spec.write_text(text)
        subprocess.run([freeplay, "simulate", spec, "--output", folder, "-q"], check=True)
    return folder


def settled_run(freeplay, folder):
    """CPU seconds of a run over a fleet, into the store it has."""
    return measured([freeplay, "--config", str(folder / "pipeline.toml"), "run", "-q", "--jobs", "1"])["cpu_s"]


def fresh_run(freeplay, folder):
    """CPU seconds of a run over a fleet, into a new store."""
    shutil.rmtree(folder / "results", ignore_errors=True)
    return settled_run(freeplay, folder)


def fleets(freeplay, folder):
    """By name and size: the fleets."""
    made = {"rows of one actuator": {}, "files of 20,000 rows": {}, "actuators of 20,000 rows in one file": {}}
    rows, files, actuators = made.values()
    for scale in DECADES:
        rows[10_000 * scale] = fleet(freeplay, folder / f"rows-{scale}", 1, 10_000 * scale, 1)
        files[scale] = fleet(freeplay, folder / f"files-{scale}", scale, 20_000, 1)
        actuators[scale] = fleet(freeplay, folder / f"actuators-{scale}", 1, 20_000, scale)
    return made


def exponent(costs, fixed_s):
    """Slope of ln cost on ln size over the last decade: one where the cost is linear."""
    sizes = sorted(costs)
    most, tenth = sizes[-1], next(size for size in sizes if size * 10 >= sizes[-1])
    return math.log((costs[most] - fixed_s) / (costs[tenth] - fixed_s)) / math.log(most / tenth)


def picture(found, fixed_s, path):
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot

    matplotlib.rcParams.update({"svg.hashsalt": "freeplay", "font.size": 9})
    figure, panes = pyplot.subplots(1, len(found), figsize=(10, 3.4), sharey=True)
    for pane, (name, costs) in zip(panes, found.items()):
        sizes = sorted(costs)
        spent = [max(costs[size] - fixed_s, 1e-3) for size in sizes]
        pane.loglog(sizes, spent, "o-", color="#0b6e99")
        pane.loglog(sizes, [spent[-1] * size / sizes[-1] for size in sizes], ":", color="#888888")
        pane.set_xlabel(name)
        pane.grid(True, which="major", color="#dddddd")
    panes[0].set_ylabel("CPU s of a run, less an idle one")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("freeplay", type=lambda text: str(Path(text).resolve()))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="where the logs are made, and found again")
    parser.add_argument("--picture", type=Path, help="where to draw it, as SVG")
    args = parser.parse_args()
    folder = (args.folder or Path(tempfile.mkdtemp(prefix="freeplay-growth-"))).resolve()
    made = fleets(args.freeplay, folder)
    found = {name: dict.fromkeys(sizes, math.inf) for name, sizes in made.items()}
    fixed_s = math.inf
    for _ in range(args.rounds):
        for name, sizes in made.items():
            for size, at in sizes.items():
                found[name][size] = min(found[name][size], fresh_run(args.freeplay, at))
        fixed_s = min(fixed_s, settled_run(args.freeplay, folder / "rows-1"))
    print(f"A run with nothing to do: {fixed_s:.3f} CPU s.\n")
    for name, costs in found.items():
        print("| " + name + " | " + " | ".join(f"{size:,}" for size in sorted(costs)) + " |")
        print("|---" * (len(costs) + 1) + "|")
        print("| CPU s | " + " | ".join(f"{costs[size]:.3f}" for size in sorted(costs)) + " |")
        print(f"\nGrows as the {exponent(costs, fixed_s):.2f}th power over the last decade.\n")
    if args.picture:
        picture(found, fixed_s, args.picture)


if __name__ == "__main__":
    main()
