"""Video streams: messages become units, units become packets, packets become bare pictures."""
