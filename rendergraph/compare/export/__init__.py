"""Sweeps for other programs: tables of results, and jobs of render farms with the tasks that they run."""
