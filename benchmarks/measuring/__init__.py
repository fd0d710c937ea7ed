"""What the benchmarks measure with: rates, and load."""
