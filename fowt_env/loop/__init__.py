"""What stands between the plant and whoever commands it, compiled: the control period and its parts."""
