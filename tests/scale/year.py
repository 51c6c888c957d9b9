"""Makes years of a fleet out of a few flown logs: year.py FLOWN TAILS DAYS OUTPUT [FLIGHTS_A_DAY]

FLOWN is a folder that `freeplay simulate` wrote (of a spec by fleet.py, say). Its logs are taken in turn; each copy says
another tail, flight and departure, so to the program all are new flights. The channels repeat: this is for the cost of a
year, not for its trends. Simulating each flight anew gives both, for about a CPU second a flight.
"""

import csv
import sys
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pyarrow.parquet as pq

BEGIN = datetime(2026, 1, 1, 2, tzinfo=timezone.utc)


def flights(tails, days, a_day):
    """Tail, flight and departure, day by day as they would arrive."""
    for day in range(days):
        for tail in range(tails):
            for leg in range(a_day):
                departure = BEGIN + timedelta(days=day, hours=leg * 24 / a_day, minutes=tail % 60)
                yield f"N{tail:05}", f"{day:04}-{leg}", departure


def main(flown, tails, days, output, a_day=4):
    output = Path(output)
    base = []
    for log in sorted((Path(flown) / "logs").glob("*/*.parquet")):
        stated = {k: v for k, v in pq.read_metadata(log).metadata.items() if k != b"ARROW:schema"}
        base.append((pq.read_table(log), stated))
    count = 0
    for tail, flight, departure in flights(int(tails), int(days), int(a_day)):
        table, stated = base[count % len(base)]
        said = {"tail_number": tail, "flight_id": flight, "departure_utc": departure.isoformat(), "tail_hours_end": None}
        metadata = {k: v for k, v in stated.items() if k.decode() not in said}
        metadata.update({k.encode(): v.encode() for k, v in said.items() if v})
        folder = output / "logs" / tail
        folder.mkdir(parents=True, exist_ok=True)
        pq.write_table(table.replace_schema_metadata(metadata), folder / f"{flight}.parquet", compression="zstd")
        count += 1
    with (Path(flown) / "installations.csv").open() as source:
        stays = list(csv.DictReader(line for line in source if not line.startswith("#")))
    with (output / "installations.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(stays[0]))
        table.writeheader()
        for tail in range(int(tails)):
            for stay in stays:
                unit = {"tail_number": f"N{tail:05}", "serial_number": f"{tail:05}-{stay['serial_number']}"}
                table.writerow({**stay, **unit, "installed_utc": "2025-01-01"})
    (output / "pipeline.toml").write_text((Path(flown) / "pipeline.toml").read_text())
    print(f"{count} logs in {output}")


if __name__ == "__main__":
    main(*sys.argv[1:])
