"""Results of a trace: the light-transport map, light curves, light by path."""
