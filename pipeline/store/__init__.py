"""The store: DuckDB tables and views, filled in bulk, a recording at a time.

parquet_parts:  what pass 1 streams to Parquet, and back
schema:         the SQL files of `schemas/sql`, applied; `upgrade` alters older tables
connection:     opening a database file, and the reasons why it cannot be opened
database:       `Store`: opening, transactions, questions
runs, recordings, estimates:  rows in and out, by functions that take a `Store`
matches, track_rows, exposure_rows:  larger reads, some frames at a time
columns, precision:  names, order and decimals of what is stored
parquet:        a whole recording as Parquet files, and back
scratch:        a database of its own for one recording
catalog:        tables and views with their comments
"""
