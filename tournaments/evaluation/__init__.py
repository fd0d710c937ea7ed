"""What a checkpoint is worth: matches against a list of fighters, on maps that no training used."""
