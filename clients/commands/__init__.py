"""The commands of those who play and watch over the network: one module each. They alone print."""
