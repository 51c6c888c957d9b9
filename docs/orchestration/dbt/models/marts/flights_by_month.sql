-- Flights, records and rejections of each tail and month of departure (UTC).
select
    date_trunc('month', departure_utc)::date as month,
    tail_number,
    count(distinct flight_id) as flights,
    count(*) as records,
    count(*) filter (where status = 'refused') as rejected,
    mode(reason) filter (where status = 'refused') as most_frequent_rejection
from {{ ref('stg_gap_records') }}
group by all
order by all
