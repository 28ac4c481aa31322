"""Checks of a recording's numbers against what people, lenses and clocks can be."""
