"""Blur of the edges of an object: the pixel side of depth from defocus.

expected.py says, before a pixel is touched, whether blur can say anything; edges.py finds straight edges
in a pyramid; edge_spread.py fits the blur of each; widths.py makes one number of an object's edges.
"""
