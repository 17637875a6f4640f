"""How a run is read: by index where there is one, chunk by chunk where it is damaged."""
