"""Where matches are played: in this process, over the network, on a Ray cluster; and what a fighter's process may use."""
