"""Measurements that need pixels: brightness, straight edges, blur; and the rows made of them."""
