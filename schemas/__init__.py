"""Formats that other programs see: protobuf messages in recordings, SQL tables and views."""
