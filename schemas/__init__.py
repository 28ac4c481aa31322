"""What crosses a boundary: protobuf messages in recordings, SQL tables and views in the store."""
