"""A night of a large fleet on simulated workers: schedule.py FLIGHTS WORKERS SECONDS_A_FLIGHT [SEED]

Flights land through the night, each worth a lognormal time around the measured cost. Workers take the longest of what has
arrived, as `freeplay run` does. One flight in a hundred takes ten times as long, one worker in fifty runs at a third of its
speed, and each worker dies once in ten hours on average, as rented spot machines may: its flight is begun again by another after a timeout.
Prints when the last flight was done, and what the bad luck cost.
"""

import heapq
import math
import random
import sys

LANDING_H = 8.0
SPREAD = 0.4
STRAGGLERS, STRAGGLE = 0.01, 10.0
SLOW_WORKERS, SLOWNESS = 0.02, 3.0
HOURS_TO_DEATH = 10.0
NOTICED_S = 120.0


def night(flights, workers, seconds, seed, bad_luck=True):
    """Seconds until the last flight is done, hours of work, and how many were begun again."""
    draw = random.Random(seed)
    landed = sorted(draw.uniform(0, LANDING_H * 3600) for _ in range(flights))
    cost = [seconds * math.exp(draw.gauss(-SPREAD**2 / 2, SPREAD)) for _ in range(flights)]
    if bad_luck:
        cost = [c * (STRAGGLE if draw.random() < STRAGGLERS else 1) for c in cost]
    speed = [SLOWNESS if bad_luck and draw.random() < SLOW_WORKERS else 1.0 for _ in range(workers)]
    free = [(0.0, worker) for worker in range(workers)]
    waiting, arrivals = [], list(zip(landed, cost))[::-1]
    again, worked, last, left = 0, 0.0, 0.0, flights
    while left:
        now, worker = heapq.heappop(free)
        while arrivals and arrivals[-1][0] <= now:
            heapq.heappush(waiting, -arrivals.pop()[1])
        if not waiting:
            if arrivals:
                heapq.heappush(free, (arrivals[-1][0], worker))
            continue
        need = -heapq.heappop(waiting)
        takes = need * speed[worker]
        dies = draw.expovariate(1 / (HOURS_TO_DEATH * 3600)) if bad_luck else math.inf
        if dies < takes:
            again += 1
            arrivals.append((now + dies + NOTICED_S, need))
            arrivals.sort(reverse=True)
            heapq.heappush(free, (now + dies + NOTICED_S, worker))
            worked += dies
            continue
        worked += takes
        last, left = max(last, now + takes), left - 1
        heapq.heappush(free, (now + takes, worker))
    return last, worked / 3600, again


def main(flights, workers, seconds, seed=1):
    for name, bad_luck in (("good luck", False), ("bad luck", True)):
        last, worked, again = night(int(flights), int(workers), float(seconds), int(seed), bad_luck)
        behind = last / 60 - LANDING_H * 60
        print(f"{name}: done {behind:.1f} min after the last landing hour, {worked:.1f} h of work, {again} begun again")


if __name__ == "__main__":
    main(*sys.argv[1:])
