"""Orders to robots, followed level by level until they are proved."""
