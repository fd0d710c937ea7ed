"""The fighters, and what makes them. `policies.registry` knows them by name."""
