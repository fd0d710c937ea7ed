"""The web client: a page that hears the pit over Zenoh like everyone else, and may run elsewhere."""
