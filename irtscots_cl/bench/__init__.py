"""What the tracer can do: its speed on a device (throughput), how its time grows with a job (scaling), and what error
is had for what time (accuracy)."""
