"""The local venue: both fighters in this process, many matches in one batch, batches on all cores."""
