"""Running a league: preflight, scheduler, recovery, progress."""
