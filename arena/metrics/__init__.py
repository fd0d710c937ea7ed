"""What the processes of an arena tell a monitor about themselves: `/healthz`, and `/metrics` for Prometheus."""
