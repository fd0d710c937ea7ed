"""A person who commands a team: orders, routes, the view model of a screen, and the mailbox between screen and client."""
