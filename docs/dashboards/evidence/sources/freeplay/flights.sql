select * from read_parquet('${data}/flights.parquet')
