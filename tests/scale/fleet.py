"""Writes the spec of a fleet's year of light logs for `freeplay simulate`: fleet.py TAILS DAYS [FLIGHTS_A_DAY] > spec.toml

Each log is 40 s at 50 Hz with 20 actuators of one design: what a year costs in files, rows and
commits is that of full logs, at a hundredth of their bytes.
"""

import sys

POSITIONS = 20

PART = """
[[parts]]
part_number = "EMA-27-1040"
limit_m = 200e-6
gap_m = [50e-6, 90e-6]
"""


def spec(tails, days, flights_a_day):
    names = ", ".join(f'"N{i:05}"' for i in range(tails))
    head = f"""# {tails} aircraft, {days} days, {flights_a_day} flights a day: made by tests/scale/fleet.py
seed = 9
start_date = "2026-01-01"
tails = [{names}]
flights_per_tail = {days * flights_a_day}
days_between_flights = {1 / flights_a_day}

[profile]
duration_s = 40
sample_rate_hz = 50
"""
    place = '\n[[positions]]\nposition = "surface_{:02}"\npart_number = "EMA-27-1040"\n'
    return head + PART + "".join(place.format(i) for i in range(POSITIONS))


if __name__ == "__main__":
    tails, days, *rest = map(int, sys.argv[1:])
    print(spec(tails, days, *(rest or [4])))
