-- The latest estimate of each unit, wherever it is installed, and its rejected flights since then.
with records as (
    select * from {{ ref('stg_gap_records') }}
),

estimates as (
    select *
    from records
    where status = 'estimated'
    qualify row_number() over (
        partition by part_number, serial_number
        order by departure_utc desc, flight_id desc
    ) = 1
),

units as (
    select part_number, serial_number, count(*) as flights
    from records
    group by all
)

select
    units.part_number,
    units.serial_number,
    estimates.tail_number,
    estimates.position,
    estimates.flight_id,
    estimates.departure_utc,
    estimates.gap_m,
    estimates.gap_p05_m,
    estimates.gap_p95_m,
    units.flights,
    (
        select count(*)
        from records
        where
            records.part_number = units.part_number
            and records.serial_number = units.serial_number
            and records.status = 'refused'
            and (estimates.departure_utc is null or records.departure_utc > estimates.departure_utc)
    ) as rejected_since
from units
left join estimates using (part_number, serial_number)
