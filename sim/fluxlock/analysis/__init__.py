"""From run data to metrics, plots and reports. Knows neither the simulator nor the plant."""
