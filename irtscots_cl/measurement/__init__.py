"""MEASUREMENT: images and design to height. Never imports tracing, opencl, execution."""
