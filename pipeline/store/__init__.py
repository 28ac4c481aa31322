"""The store: DuckDB tables and views, filled in bulk, a recording at a time.

parts:       what pass 1 streams to Parquet
schema:      the SQL files of `schemas/sql`, applied
connection:  opening a database, and why it cannot be opened
precision:   how many decimals are kept
catalog:     what there is to ask
database:    runs, recordings and estimates in and out, in transactions
"""
