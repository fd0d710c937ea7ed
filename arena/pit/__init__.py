"""The open pit: who is admitted, who meets whom, every match and its session on the network, the lobby and the archive."""
