select * from read_parquet('${data}/units.parquet')
