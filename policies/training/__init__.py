"""How fighters are made: rollouts, cloning, policy gradients, runs that can be killed."""
