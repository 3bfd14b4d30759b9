"""What every capability stands on: settings, problems, jobs, workers, the live stream."""
