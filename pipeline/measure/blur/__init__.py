"""How blurred the edges of an object are: the pixel side of depth from defocus.

expect.py says, before a pixel is touched, whether blur can say anything; edges.py finds straight edges
in a pyramid; spread.py fits the blur of each; measure.py makes one number of an object's edges.
"""
