"""What a league's results look like: text, Markdown, CSV, JSON, HTML, and the leagues of the web page."""
