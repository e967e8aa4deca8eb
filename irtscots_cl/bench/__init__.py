"""What the tracer can do: its speed on a device (throughput), and how its time grows with a job (scaling, cores)."""
