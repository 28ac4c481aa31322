"""The accuracy report: one HTML file, made of a database."""
