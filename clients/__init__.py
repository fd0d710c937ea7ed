"""Programs that carry a policy, or a person, to the pit."""
