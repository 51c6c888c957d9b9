-- One row per actuator and flight, with the names and units of the store.
select
    tail_number,
    position,
    part_number,
    serial_number,
    flight_id,
    departure_utc at time zone 'UTC' as departure_utc,
    flight_hours,
    unit_hours,
    status,
    reason,
    flags,
    gap_m,
    gap_se_m,
    gap_p05_m,
    gap_p95_m,
    stiffness_n_per_m,
    run_id,
    processed_utc at time zone 'UTC' as processed_utc
from {{ source('freeplay', 'gaps') }}
