"""Work on files that a command and a job both do: optimise, identify, diagnose."""
